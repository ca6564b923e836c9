// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <memory>
#include <string>

#include "config/model_file.h"
#include "physics/number_text.h"
#include "physics/result_units.h"
#include "physics/simulator.h"
#include "protocol/recording.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/recording_input.h"
#include "tools/command_line/recording_output.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/processing/simulation.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;

namespace {

struct Arguments {
  std::string model;
  std::string drive;
  std::string out = "-";
  std::uint64_t seed = 1;
  bool no_noise = false;
};

int run(const Arguments& arguments, const Outputs& outputs) {
  const physics::Model model = config::load_model(arguments.model);
  const protocol::Recording drive = recording_from(arguments.drive);
  physics::SimulationOptions options;
  options.seed = arguments.seed;
  options.noise = !arguments.no_noise;
  terminal::Progress progress("simulating");
  protocol::Recording out = processing::simulated(
      model, arguments.model, drive, options, [&progress](double share) { progress.at(share); });
  progress.finish();
  out.source = arguments.out;
  write_recording(outputs, out, arguments.out);
  if (arguments.out != "-") {
    const double length_s =
        static_cast<double>(out.frames.back().time_ns - out.frames.front().time_ns) * 1.0e-9;
    terminal::print("%s: %s over %.3f%s\n", arguments.out.c_str(),
                    physics::counted(out.frames.size(), "sample").c_str(), length_s,
                    physics::ResultUnits(model).after_number("s").c_str());
  }
  return 0;
}

}  // namespace

void add_simulate(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "simulate", "Simulate a model under a recorded excitation and write its sensor readings");
  add_model_option(*command, arguments->model);
  add_input(*command, "--drive", arguments->drive,
            "Excitation: a recording with base_displacement_m, drive_force_n or, for imposed "
            "motion, displacement_m")
      ->required();
  add_output(*command, "--out", arguments->out,
             "Recording to write (.csv or .log; -: CSV on standard output)")
      ->capture_default_str();
  add_seed_option(*command, arguments->seed);
  command->add_flag("--no-noise", arguments->no_noise, "Simulate without sensor noise");
  command->callback([&action, arguments, command] {
    action = [arguments, command] { return run(*arguments, outputs_of(*command)); };
  });
  describe(
      *command,
      {.examples = {{"Simulate the sensor readings of a rig under a recorded drive",
                     "stickslip simulate --model model.toml --drive run.csv --out simulated.csv"}},
       .files = {recording_files, model_files},
       .see_also = {"stickslip-conceal(1)", "stickslip-evaluate(1)"}});
}

}  // namespace stickslip::commands
