// `stickslip doctor`: is this machine one for a rig? What is not, and the command that mends it.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "config/rig.h"
#include "protocol/channels.h"
#include "tools/command_line/colour_option.h"
#include "tools/command_line/option_checks.h"
#include "tools/commands/commands.h"
#include "tools/doctor/examination.h"
#include "tools/doctor/needs.h"
#include "tools/doctor/report.h"
#include "tools/linux_host/linux_host.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace linux_host;

using namespace command_line;
using namespace linux_host;
namespace {

// About what all takes beside the measurement of wake-ups.
constexpr double other_checks_s = 1.0;

struct Arguments {
  std::string config;
  double duration_s = 1.0;
  bool json = false;
  terminal::Colours colours = terminal::Colours::automatic;
};

doctor::Needs needs(const Arguments& arguments) {
  if (!arguments.config.empty()) return doctor::needs_of(config::load_rig(arguments.config));
  const char* url = std::getenv("LCM_DEFAULT_URL");
  return doctor::needs_without_rig(url != nullptr && *url != '\0' ? url : protocol::default_url);
}

int run(const Arguments& arguments) {
  doctor::Needs rig = needs(arguments);
  rig.latency_duration_s = arguments.duration_s;
  terminal::Progress progress("examining this machine");
  progress.takes(arguments.duration_s + other_checks_s);
  const std::vector<doctor::Finding> findings = doctor::examine(LinuxHost(), rig);
  progress.finish();
  const terminal::Paint paint(terminal::wants_colour(arguments.colours, STDOUT_FILENO));
  std::fputs((arguments.json ? doctor::json(findings) : doctor::text(findings, paint)).c_str(),
             stdout);
  return doctor::worst(findings) == doctor::Verdict::fail ? 1 : 0;
}

}  // namespace

void add_doctor(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "doctor", "Try everything that a rig needs of this machine, and tell what mends the rest");
  command->add_option("--config", arguments->config,
                      "The rig that shall run here (TOML); without it, the defaults");
  command->add_option("--duration", arguments->duration_s, "For how long wake-ups are measured [s]")
      ->check(positive_number())
      ->capture_default_str();
  command->add_flag("--json", arguments->json, "As JSON");
  add_colour_option(*command, arguments->colours);
  command->footer(
      "Nothing is changed, and no packet leaves the host. Exit status: 0 nothing fails; 1 "
      "something "
      "does.");
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stickslip::commands
