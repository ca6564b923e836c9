// SPDX-License-Identifier: Apache-2.0
// `stickslip poincare`: Poincare sections of a model.
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "config/model_file.h"
#include "physics/number_text.h"
#include "physics/result_units.h"
#include "tools/command_line/drive_options.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/commands/commands.h"
#include "tools/dynamics/portrait.h"
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
  double phase = 0.0;
  std::string out = "-";
};

int run(const Arguments& arguments, const Outputs& outputs) {
  const physics::Model model = config::load_model(arguments.drive->model);
  const dynamics::Drive drive = arguments.drive->drive(model, arguments.periods);
  dynamics::PortraitOptions options = arguments.drive->portrait();
  options.periods = arguments.periods;
  options.phase = arguments.phase;

  terminal::Progress progress("integrating the orbit");
  // Ranges and shares require a second integration.
  const double runs = arguments.out == "-" ? 1.0 : 2.0;
  options.progress = [&](double share) { progress.at(share / runs); };
  const physics::ResultUnits units(model);
  std::string table = units.column("time_s", "s") + "," + units.column("displacement_m", "m") +
                      "," + units.column("velocity_m_s", "m/s") + ",theta\n";
  const std::vector<dynamics::Point> section = dynamics::poincare_section(model, drive, options);
  if (arguments.out == "-") progress.finish();
  for (const dynamics::Point& point : section) {
    table += physics::number_text(point.time_s, 9);
    for (const double each : {point.x(), point.v(), point.state.theta}) {
      table += ',' + physics::number_text(each, 9);
    }
    table += '\n';
  }
  outputs.write(arguments.out, Form::plain, table);
  if (arguments.out == "-") return 0;

  options.progress = [&](double share) { progress.at((1.0 + share) / runs); };
  const dynamics::Portrait portrait = dynamics::portrait(model, drive, options);
  progress.finish();
  terminal::print(
      "displacement %.5g to %.5g%s, velocity %.5g to %.5g%s, normal load %.4g to %.4g%s\n",
      portrait.displacement_m.low, portrait.displacement_m.high, units.after_number("m").c_str(),
      portrait.velocity_m_s.low, portrait.velocity_m_s.high, units.after_number("m/s").c_str(),
      portrait.normal_load_n.low, portrait.normal_load_n.high, units.after_number("N").c_str());
  terminal::print(
      "contact lost %.2f %% of the time, friction and velocity of opposite sign %.2f %%, at rest "
      "%.2f %%; "
      "overshoot %.2f %% of the velocity range over %s\n",
      100.0 * portrait.contact_lost, 100.0 * portrait.negative_friction, 100.0 * portrait.sticking,
      100.0 * portrait.overshoot, physics::counted(portrait.arrivals, "arrival").c_str());
  return 0;
}

}  // namespace

void add_poincare(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "poincare", "Compute a Poincare section of a model under a periodic drive");
  add_drive_options(*command, arguments->drive);
  command
      ->add_option("--periods", arguments->periods, "Points of the section, one per drive period")
      ->check(whole_number(1, 10000000))
      ->capture_default_str();
  command->add_option("--phase", arguments->phase, "Phase of the section, in turns of the drive")
      ->check(finite_number())
      ->capture_default_str();
  add_output(*command, "--out", arguments->out, "Table to write (CSV; -: standard output)")
      ->capture_default_str();
  command->footer("With --out FILE, ranges, lost contact, sticking and overshoot are printed.");
  command->callback([&action, arguments, command] {
    action = [arguments, command] { return run(*arguments, outputs_of(*command)); };
  });
  describe(*command, {.examples = {{"Compute a section at 4.2 Hz",
                                    "stickslip poincare --model config/models/motivational.toml "
                                    "--frequency-hz 4.2 --amplitude 0.008 --out section.csv"}},
                      .files = {model_files},
                      .see_also = {"stickslip-lyapunov(1)", "stickslip-bifurcation(1)"}});
}

}  // namespace stickslip::commands
