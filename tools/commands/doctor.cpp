// SPDX-License-Identifier: Apache-2.0
// `stickslip doctor`: checks this machine against the requirements of a rig.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "config/rig.h"
#include "protocol/channels.h"
#include "tools/command_line/colour_option.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/doctor/examination.h"
#include "tools/doctor/report.h"
#include "tools/doctor/requirements.h"
#include "tools/linux_host/linux_host.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace linux_host;
namespace {

// Approximate duration of all checks except the wake-up measurement.
constexpr double other_checks_s = 1.0;

struct Arguments {
  std::string config;
  double duration_s = 1.0;
  bool json = false;
  terminal::Colours colours = terminal::Colours::automatic;
};

doctor::Requirements requirements(const Arguments& arguments) {
  if (!arguments.config.empty()) {
    return doctor::requirements_of(config::load_rig(arguments.config));
  }
  const char* url = std::getenv("LCM_DEFAULT_URL");
  return doctor::default_requirements(url != nullptr && *url != '\0' ? url : protocol::default_url);
}

int run(const Arguments& arguments) {
  doctor::Requirements rig = requirements(arguments);
  rig.latency_duration_s = arguments.duration_s;
  terminal::Progress progress("examining this machine");
  progress.set_duration(arguments.duration_s + other_checks_s);
  const std::vector<doctor::Finding> findings = doctor::run_checks(LinuxHost(), rig);
  progress.finish();
  const terminal::Paint paint(terminal::wants_colour(arguments.colours, STDOUT_FILENO));
  if (arguments.json) {
    std::fputs(doctor::json(findings).c_str(), stdout);
  } else {
    terminal::print_page(doctor::text(findings, paint));
  }
  return doctor::worst(findings) == doctor::Verdict::fail ? 1 : 0;
}

}  // namespace

void add_doctor(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "doctor", "Check this machine against the requirements of a rig, and print the remedies");
  add_input(*command, "--config", arguments->config,
            "Rig to check for (TOML); without it, the defaults")
      ->transform(shipped_file(""));
  command
      ->add_option("--duration", arguments->duration_s, "Duration of the wake-up measurement [s]")
      ->check(positive_number())
      ->capture_default_str();
  add_json_flag(*command, arguments->json);
  add_colour_option(*command, arguments->colours);
  command->footer(
      "Nothing is changed, and no packet leaves the host. Exit status: 0 no check fails; 1 one "
      "fails.");
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
  describe(*command, {.examples = {{"Check this machine for a rig",
                                    "stickslip doctor --config config/simulated.toml"},
                                   {"Measure the tail of the wake-up latency over ten minutes",
                                    "stickslip doctor --duration 600"}},
                      .environment = {lcm_url_variable, no_color_variable},
                      .see_also = {"stickslip-check(1)", "stickslipd(8)"}});
}

}  // namespace stickslip::commands
