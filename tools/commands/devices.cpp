// SPDX-License-Identifier: Apache-2.0
// `stickslip devices`: the supported devices of this host and their problems.
#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "drivers/factory/find_devices.h"
#include "protocol/json_text.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
namespace {

using drivers::AttachedDevice;

struct Arguments {
  bool json = false;
};

void print_json(const std::vector<AttachedDevice>& devices) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const AttachedDevice& device : devices) {
    list.push_back({{"kind", device.kind},
                    {"name", device.name},
                    {"serial", device.serial},
                    {"where", device.location},
                    {"speaks", device.problem.empty()},
                    {"trouble", device.problem}});
  }
  std::printf("%s\n", protocol::json_text(nlohmann::ordered_json{{"devices", list}}).c_str());
}

void print_text(const std::vector<AttachedDevice>& devices) {
  if (devices.empty()) {
    terminal::print_page(
        "No board, bridge or GPIO chip is attached. Units on Modbus do not announce "
        "themselves: `stickslip check --live RIG.toml` probes those of a rig.\n");
  }
  for (const AttachedDevice& device : devices) {
    terminal::print("%s\n  kind    %s\n", device.name.c_str(), device.kind.c_str());
    if (!device.serial.empty()) terminal::print("  serial  %s\n", device.serial.c_str());
    terminal::print("  where   %s\n", device.location.c_str());
    terminal::print("  state   %s\n", device.problem.empty() ? "responds" : device.problem.c_str());
  }
}

int run(const Arguments& arguments) {
  terminal::Progress progress("identifying devices");
  const std::vector<AttachedDevice> devices = drivers::find_devices();
  progress.finish();
  if (arguments.json) {
    print_json(devices);
  } else {
    print_text(devices);
  }
  const bool ok = std::all_of(devices.begin(), devices.end(),
                              [](const AttachedDevice& device) { return device.problem.empty(); });
  return ok ? 0 : 1;
}

}  // namespace

void add_devices(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "devices", "List the boards, bridges and GPIO chips of this host, and their problems");
  add_json_flag(*command, arguments->json);
  command->footer(
      "Devices are identified only, and nothing is driven; one in use by a running daemon is "
      "reported as "
      "busy. Exit status: 0 all attached devices respond; 1 one of them has a problem.");
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
  describe(*command, {.examples = {{"List the attached devices", "stickslip devices"}},
                      .see_also = {"stickslip-check(1)", "stickslip-doctor(1)"}});
}

}  // namespace stickslip::commands
