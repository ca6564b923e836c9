// `stickslip devices`: what is attached to this host that a rig could use, and what is wrong with
// it.
#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "drivers/find_devices.h"
#include "tools/commands/commands.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {
namespace {

using drivers::Attached;

struct Arguments {
  bool json = false;
};

void print_json(const std::vector<Attached>& devices) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Attached& device : devices) {
    list.push_back({{"kind", device.kind},
                    {"name", device.name},
                    {"serial", device.serial},
                    {"where", device.where},
                    {"speaks", device.trouble.empty()},
                    {"trouble", device.trouble}});
  }
  std::printf("%s\n", nlohmann::ordered_json{{"devices", list}}.dump(2).c_str());
}

void print_text(const std::vector<Attached>& devices) {
  if (devices.empty()) {
    std::puts(
        "No board, bridge or GPIO chip is attached. Units on Modbus do not announce "
        "themselves: `stickslip check --live RIG.toml` asks those that a rig names.");
  }
  for (const Attached& device : devices) {
    std::printf("%s\n  kind    %s\n", device.name.c_str(), device.kind.c_str());
    if (!device.serial.empty()) std::printf("  serial  %s\n", device.serial.c_str());
    std::printf("  where   %s\n", device.where.c_str());
    std::printf("  state   %s\n", device.trouble.empty() ? "speaks" : device.trouble.c_str());
  }
}

int run(const Arguments& arguments) {
  terminal::Progress progress("asking the devices");
  const std::vector<Attached> devices = drivers::find_devices();
  progress.finish();
  if (arguments.json) {
    print_json(devices);
  } else {
    print_text(devices);
  }
  const bool well = std::all_of(devices.begin(), devices.end(),
                                [](const Attached& device) { return device.trouble.empty(); });
  return well ? 0 : 1;
}

}  // namespace

void add_devices(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "devices",
      "List the boards, bridges and GPIO chips of this host, and what is wrong with them");
  command->add_flag("--json", arguments->json, "As JSON");
  command->footer(
      "Devices are asked who they are, and nothing else; those that a running daemon holds say so. "
      "Exit status: 0 all that are there speak; 1 something is wrong with one.");
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stickslip::commands
