// SPDX-License-Identifier: Apache-2.0
// `stickslip lyapunov`: the largest Lyapunov exponent of a model.
#include "tools/dynamics/lyapunov.h"

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "config/model_file.h"
#include "physics/number_text.h"
#include "protocol/json_text.h"
#include "tools/command_line/drive_options.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/files/outputs.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace files;

namespace {

struct Arguments {
  std::shared_ptr<DriveOptions> drive = std::make_shared<DriveOptions>();
  int periods = 2000;
  std::string json;
};

int run(const Arguments& arguments, const Outputs& outputs) {
  const physics::Model model = config::load_model(arguments.drive->model);
  const dynamics::Drive drive = arguments.drive->drive(model, arguments.periods);
  dynamics::LyapunovOptions options;
  options.periods = arguments.periods;
  options.transient = arguments.drive->transient;
  options.steps_per_period = arguments.drive->steps;
  options.x_m = arguments.drive->x_m;
  options.v_m_s = arguments.drive->v_m_s;
  terminal::Progress progress("integrating two orbits");
  options.progress = [&progress](double share) { progress.at(share); };
  const dynamics::Lyapunov found = dynamics::largest_exponent(model, drive, options);
  progress.finish();

  const char* verdict = "not significantly different from zero: periodic or quasi-periodic";
  if (found.exponent_per_s > 3.0 * found.standard_error_per_s) verdict = "chaotic";
  if (found.exponent_per_s < -3.0 * found.standard_error_per_s) verdict = "periodic";
  terminal::print(
      "largest Lyapunov exponent %s +- %.4f per %s (one standard error), %s per drive "
      "period, over %s: %s\n",
      physics::fixed_text(found.exponent_per_s, 4).c_str(), found.standard_error_per_s,
      model.dimensionless ? "unit of time" : "second",
      physics::fixed_text(found.per_period, 3).c_str(),
      physics::counted(arguments.periods, "period").c_str(), verdict);
  if (!arguments.json.empty()) {
    nlohmann::ordered_json json;
    json["schema"] = 1;
    json["exponent_per_s"] = found.exponent_per_s;
    json["standard_error_per_s"] = found.standard_error_per_s;
    json["per_period"] = found.per_period;
    json["periods"] = arguments.periods;
    if (model.dimensionless) json["dimensionless"] = true;
    outputs.write(arguments.json, Form::json, protocol::json_text(json) + "\n");
  }
  return 0;
}

}  // namespace

void add_lyapunov(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "lyapunov", "Estimate the largest Lyapunov exponent of a model under a periodic drive");
  add_drive_options(*command, arguments->drive);
  command->add_option("--periods", arguments->periods, "Drive periods to average over")
      ->check(whole_number(20, 10000000))
      ->capture_default_str();
  add_json_file_option(*command, arguments->json);
  command->callback([&action, arguments, command] {
    action = [arguments, command] { return run(*arguments, outputs_of(*command)); };
  });
  describe(*command, {.examples = {{"Test for chaos",
                                    "stickslip lyapunov --model config/models/paper-figure-10.toml "
                                    "--omega 1.25 --acceleration 1.9 --x 0.5"}},
                      .files = {model_files},
                      .see_also = {"stickslip-poincare(1)", "stickslip-bifurcation(1)"}});
}

}  // namespace stickslip::commands
