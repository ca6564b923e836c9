// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "config/model_file.h"
#include "physics/integration_cost.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "physics/result_units.h"
#include "physics/simulator.h"
#include "protocol/recording.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/recording_input.h"
#include "tools/command_line/recording_output.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
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

// Derivatives of non-uniform samples by a quartic through five neighbours: a parabola is too coarse
// for the acceleration of the base.
struct Derivatives {
  double first = 0.0;
  double second = 0.0;
};

Derivatives derivatives_at(const std::vector<double>& t, const std::vector<double>& y,
                           std::size_t i) {
  const std::size_t n = t.size();
  const std::size_t points = std::min<std::size_t>(5, n);
  const std::size_t from = std::min(i >= 2 ? i - 2 : 0, n - points);
  // Derivatives at t[i] of the Lagrange basis polynomials.
  Derivatives out;
  for (std::size_t j = from; j < from + points; ++j) {
    double first = 0.0;
    double second = 0.0;
    for (std::size_t k = from; k < from + points; ++k) {
      if (k == j) continue;
      double product = 1.0;
      for (std::size_t l = from; l < from + points; ++l) {
        if (l != j && l != k) product *= (t[i] - t[l]) / (t[j] - t[l]);
      }
      first += product / (t[j] - t[k]);
      for (std::size_t l = from; l < from + points; ++l) {
        if (l == j || l == k) continue;
        double rest = 1.0;
        for (std::size_t q = from; q < from + points; ++q) {
          if (q != j && q != k && q != l) rest *= (t[i] - t[q]) / (t[j] - t[q]);
        }
        second += rest / ((t[j] - t[k]) * (t[j] - t[l]));
      }
    }
    out.first += first * y[j];
    out.second += second * y[j];
  }
  return out;
}

std::vector<physics::Input> inputs_of(const protocol::Recording& drive, const physics::Model& model,
                                      const std::vector<double>& time) {
  const auto column = [&](Channel channel, const char* role) {
    std::vector<double> values;
    for (const Frame& frame : drive.frames) {
      if (!frame.has(channel)) {
        throw InputError(Problem{drive.source, 0, 0,
                                 "lacks " + std::string(info(channel).column) + " at time " +
                                     std::to_string(frame.time_s()) + " s, which " + role});
      }
      values.push_back(frame[channel]);
    }
    return values;
  };
  std::vector<physics::Input> inputs(drive.frames.size());
  switch (model.oscillator.excitation) {
    case physics::Excitation::base: {
      const auto b = column(Channel::base_displacement, "drives a base-excited rig");
      for (std::size_t i = 0; i < b.size(); ++i) {
        inputs[i].base_displacement_m = b[i];
        inputs[i].base_acceleration_m_s2 = derivatives_at(time, b, i).second;
      }
      break;
    }
    case physics::Excitation::force: {
      const auto f = column(Channel::drive_force, "drives a force-excited rig");
      for (std::size_t i = 0; i < f.size(); ++i) inputs[i].drive_force_n = f[i];
      break;
    }
    case physics::Excitation::imposed: {
      const auto x = column(Channel::displacement, "is the imposed motion");
      for (std::size_t i = 0; i < x.size(); ++i) {
        inputs[i].displacement_m = x[i];
        inputs[i].velocity_m_s = derivatives_at(time, x, i).first;
      }
      break;
    }
  }
  if (model.normal_load && model.normal_load->law == physics::NormalLoadLaw::measured) {
    const auto load = column(Channel::normal_load, "the normal-load law \"measured\" takes as N");
    for (std::size_t i = 0; i < load.size(); ++i) inputs[i].normal_load_n = load[i];
  }
  return inputs;
}

// Sample times from 0. Refuses gaps over which an interpolated excitation has no meaning.
std::vector<double> times_of(const protocol::Recording& drive, const std::string& name) {
  constexpr double longest_s = 3600.0;
  std::vector<double> time;
  for (const Frame& frame : drive.frames) {
    time.push_back(static_cast<double>(frame.time_ns - drive.frames.front().time_ns) * 1.0e-9);
    if (time.size() < 2) continue;
    const double gap_s = time.back() - time[time.size() - 2];
    if (gap_s <= longest_s) continue;
    throw InputError(Problem{name, 0, 0,
                             "the sample at " + std::to_string(frame.time_s()) + " s comes " +
                                 std::to_string(gap_s) + " s after the one before; expected at " +
                                 "most " + std::to_string(longest_s) + " s"});
  }
  return time;
}

int run(const Arguments& arguments, const Outputs& outputs) {
  const physics::Model model = config::load_model(arguments.model);
  const protocol::Recording drive = recording_from(arguments.drive);
  if (drive.frames.size() < 5) {
    throw InputError(Problem{arguments.drive, 0, 0, "contains fewer than 5 samples"});
  }
  const std::vector<double> time = times_of(drive, arguments.drive);
  const auto inputs = inputs_of(drive, model, time);
  const std::string wrong = physics::wrong_with_simulation(model, time.back());
  if (!wrong.empty()) throw InputError(Problem{arguments.model, 0, 0, wrong});

  physics::SimulationOptions options;
  options.seed = arguments.seed;
  options.noise = !arguments.no_noise;
  physics::RigSimulator simulator(model, options);
  simulator.set_input(inputs.front());
  protocol::Recording out;
  out.source = arguments.out;
  terminal::Progress progress("simulating");
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    progress.at(i, inputs.size());
    if (i > 0) simulator.advance(time[i] - time[i - 1], inputs[i]);
    Frame frame = simulator.read();
    frame.time_ns = drive.frames[i].time_ns;
    out.channels |= frame.valid;
    out.frames.push_back(frame);
  }
  progress.finish();
  write_recording(outputs, out, arguments.out);
  if (arguments.out != "-") {
    terminal::print("%s: %s over %.3f%s\n", arguments.out.c_str(),
                    physics::counted(out.frames.size(), "sample").c_str(), time.back(),
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
