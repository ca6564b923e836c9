// SPDX-License-Identifier: Apache-2.0
// `stickslip ctl calibrate`: a channel's calibration with readings from a running daemon.
#include <chrono>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "physics/frame.h"
#include "physics/problem.h"
#include "tools/calibration/calibration_file.h"
#include "tools/calibration/dialog.h"
#include "tools/calibration/words.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/control_client/control_client.h"
#include "tools/files/utc_now.h"
#include "tools/terminal/page.h"

namespace stickslip::commands {

using namespace calibration;
using namespace command_line;
using namespace control_client;
namespace {

using namespace std::chrono_literals;
using calibration::Dialog;
using nlohmann::json;

struct Arguments {
  std::shared_ptr<const std::string> socket;
  std::string channel;
  std::string file;
  double seconds = 5.0;
  std::optional<double> gravity_m_s2;
};

/// Passes the dialog a reading of the channel, or the reason why there is none.
void offer_reading(Dialog& dialog, ControlClient& client, const Arguments& arguments) {
  const auto timeout =
      10s + std::chrono::milliseconds(static_cast<std::int64_t>(arguments.seconds * 1e3));
  const json answer = client.ask("average", {{"seconds", arguments.seconds}}, timeout);
  if (!answer.value("ok", false)) {
    return dialog.reading_failed(answer.value("error", "no reason given by the daemon"));
  }
  const json& raw = answer.at("average").at("raw");
  const auto found = raw.find(arguments.channel);
  if (found == raw.end()) return dialog.reading_failed("the channel was never valid");
  dialog.offer({found->value("mean", 0.0), found->value("deviation", 0.0),
                found->value("independent", 1.0)});
}

void show(Dialog& dialog) {
  terminal::print_page(dialog.take_text());
  std::fflush(stdout);
}

int run(const Arguments& arguments) {
  const Channel channel = *channel_named(arguments.channel);
  ControlClient client(control_socket(*arguments.socket));
  const std::string state = client.ask("alive").value("state", "");
  if (state == "running" || state == "stopping") {
    throw InputError(
        Problem{"", 0, 0, "the rig is running: stickslip ctl stop --wait, then calibrate"});
  }
  calibration::DialogSettings settings;
  settings.channel = channel;
  settings.date = files::utc_now();
  settings.reading_s = arguments.seconds;
  settings.gravity_m_s2 = arguments.gravity_m_s2;
  settings.before = calibration_before(arguments.file, channel);
  const auto before = settings.before;
  Dialog dialog(std::move(settings));
  show(dialog);
  for (std::string line; dialog.wants() != Dialog::Wants::nothing; show(dialog)) {
    if (dialog.wants() == Dialog::Wants::reading) {
      offer_reading(dialog, client, arguments);
    } else if (std::getline(std::cin, line)) {
      dialog.answer(line);
    } else {
      dialog.answer("quit");
    }
  }
  if (!dialog.result()) {
    terminal::print("%s is unchanged\n", arguments.file.c_str());
    return 1;
  }
  renew_calibration(arguments.file, channel, *dialog.result());
  terminal::print("%s: written%s\n", arguments.file.c_str(),
                  before ? "; the previous calibration is in its history" : "");
  // Has an effect if it is the file of the daemon's rig.
  const json answer = client.ask("reload");
  if (!answer.value("ok", false)) {
    std::fprintf(stderr, "stickslip: the daemon could not reload it: %s\n",
                 answer.value("error", "").c_str());
    return 1;
  }
  for (const json& each : answer.at("changes")) {
    terminal::print("daemon: %s\n", each.get<std::string>().c_str());
  }
  return 0;
}

}  // namespace

void add_ctl_calibrate(CLI::App& ctl, std::shared_ptr<const std::string> socket, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  arguments->socket = std::move(socket);
  CLI::App* const command = ctl.add_subcommand(
      "calibrate", "Walk through zero, known weights or gauge blocks, and write the calibration");
  command->fallthrough();
  std::vector<std::string> stems;
  for (const ChannelInfo& channel : channel_table) stems.emplace_back(channel.stem);
  command->add_option("CHANNEL", arguments->channel, "Channel to calibrate")
      ->required()
      ->check(one_of(stems));
  add_calibration_file_option(*command, arguments->file);
  add_averaging_time_option(*command, arguments->seconds);
  command->add_option("--gravity", arguments->gravity_m_s2, "Local gravity, for weights [m/s2]")
      ->check(positive_number());
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stickslip::commands
