// SPDX-License-Identifier: Apache-2.0
// `stickslip ctl`: commands to a running daemon, and its answers.
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "config/key.h"
#include "physics/frame.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "tools/command_line/colour_option.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/control_client/control_client.h"
#include "tools/telemetry/lcm_client.h"
#include "tools/terminal/page.h"
#include "tools/terminal/progress.h"
#include "tools/terminal/text.h"

namespace stickslip::commands {

using namespace command_line;
using namespace control_client;
using namespace telemetry;
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using terminal::padded;
using terminal::Paint;
using terminal::Tone;

struct Arguments {
  std::string socket;
  bool json_output = false;
  terminal::Colours colours = terminal::Colours::automatic;
  bool dead_man = false;
  bool wait = false;
  double seconds = 1.0;
  double duration_s = 0.0;
  std::string key;
  double value = 0.0;
  std::vector<std::string> words;  ///< of a note
};

void print_line(const char* label, const std::string& text) {
  if (!text.empty()) terminal::print("%-11s %s\n", label, text.c_str());
}

std::string microseconds(const json& timing, const char* key) {
  return physics::number_text(timing.value(key, 0.0) * 1e6, 3);
}

std::string account_text(const json& account, const char* verb) {
  if (!account.value("enabled", false)) return "off";
  std::string out = std::to_string(account.value("delivered", std::uint64_t{0})) + ' ' + verb;
  for (const auto& [why, lost] : account.at("lost").items()) {
    if (lost != 0) out += ", " + lost.dump() + " lost (" + why + ')';
  }
  return out;
}

Tone tone_of_state(const std::string& state) {
  if (state == "faulted") return Tone::bad;
  if (state == "running") return Tone::good;
  return state == "stopping" ? Tone::warning : Tone::plain;
}

Tone tone_of_severity(const std::string& severity) {
  if (severity == "error") return Tone::bad;
  return severity == "warning" ? Tone::warning : Tone::plain;
}

void print_state(const json& answer, const Paint& paint) {
  const std::string state = answer.value("state", "");
  print_line("state", paint(tone_of_state(state), state));
  if (const std::string cause = answer.value("cause", ""); !cause.empty()) {
    print_line("fault", paint(Tone::bad, answer.value("interlock", "") + ": " + cause));
  }
  if (const std::string broken = answer.value("broken", ""); !broken.empty()) {
    print_line("broken now", broken + ": " + answer.value("broken_cause", ""));
  }
}

/// One line for each device, with its non-zero counts.
void print_counts(const json& devices) {
  for (const auto& [device, counts] : devices.items()) {
    std::string text;
    for (const auto& [name, count] : counts.items()) {
      if (count != 0) text += (text.empty() ? ": " : ", ") + count.dump() + ' ' + name;
    }
    print_line("device", device + (text.empty() ? ": nothing lost" : text));
  }
}

void print_recording(const json& status) {
  print_line("recording", account_text(status.at("ledger").at("recorded"), "recorded"));
  const auto found = status.find("recording");
  if (found == status.end() || found->is_null()) return;
  const double megabytes = 1e-6 * found->value("bytes", 0.0);
  std::string text = found->value("file", "") + ", " +
                     physics::number_text(found->value("length_s", 0.0), 4) + " s, " +
                     physics::number_text(megabytes, 4) + " MB";
  const json& free_bytes = found->at("free_bytes");
  if (free_bytes.is_number()) {
    text += "; " + physics::number_text(1e-9 * free_bytes.get<double>(), 4) + " GB free";
  }
  print_line("", text);
}

void print_status(const json& answer, const Paint& paint) {
  print_state(answer, paint);
  print_line("amplifier", answer.value("amplifier_on", false) ? "on" : "off");
  if (!answer.value("device_here", true)) print_line("device", "lost");
  const json& drive = answer.at("drive");
  print_line("drive", physics::number_text(drive.value("value", 0.0), 6) + ", amplitude " +
                          physics::number_text(drive.value("amplitude", 0.0), 6) + " at " +
                          physics::number_text(drive.value("carrier_hz", 0.0), 6) + " Hz");
  for (const auto& [stem, value] : answer.at("channels").items()) {
    const auto channel = channel_named(stem);
    print_line("channel", stem + " " + physics::number_text(value.get<double>(), 6) + " " +
                              (channel ? std::string(info(*channel).unit) : std::string()));
  }
  const json& status = answer.at("status");
  const json& ledger = status.at("ledger");
  print_line("frames", std::to_string(ledger.value("produced", std::uint64_t{0})) +
                           " produced in " +
                           physics::number_text(status.value("uptime_s", 0.0), 6) + " s");
  print_line("publishing", account_text(ledger.at("published"), "published"));
  print_recording(status);
  if (const auto source = status.find("source"); source != status.end()) {
    print_counts(source->value("devices", json::object()));
  }
  if (const auto model = status.find("model"); model != status.end()) {
    print_line("model", model->value("statement", model->value("standing", "")));
    if (const auto why = model->value("explained", ""); !why.empty()) print_line("", why);
  }
  const json& timing = status.at("timing");
  print_line("timing", "wake-up late by " + microseconds(timing, "lateness_p99_s") +
                           " us (99 %), " + microseconds(timing, "lateness_max_s") +
                           " us (longest); " +
                           physics::counted(timing.value("overruns", std::uint64_t{0}), "overrun") +
                           (timing.value("degraded", false) ? "; degraded" : ""));
}

Paint paint_of(const Arguments& arguments) {
  return Paint(terminal::wants_colour(arguments.colours, STDOUT_FILENO));
}

/// Prints the answer as text or JSON; returns the exit status.
int report(const Arguments& arguments, const json& answer,
           void (*print)(const json&, const Paint&)) {
  if (arguments.json_output) {
    std::printf("%s\n", answer.dump().c_str());
  } else if (answer.value("ok", false)) {
    print(answer, paint_of(arguments));
  }
  if (answer.value("ok", false)) return 0;
  if (!arguments.json_output) {
    std::fprintf(stderr, "stickslip: refused by the daemon: %s\n",
                 answer.value("error", "no reason given").c_str());
  }
  return 1;
}

int simple(const Arguments& arguments, const std::string& command) {
  ControlClient client(control_socket(arguments.socket));
  return report(arguments, client.ask(command), print_state);
}

int status(const Arguments& arguments) {
  ControlClient client(control_socket(arguments.socket));
  return report(arguments, client.ask("status"), print_status);
}

/// Waits until the rig has left `state`, without a time limit.
json wait_while(ControlClient& client, const std::string& state) {
  json answer = client.ask("alive");
  while (answer.value("state", "") == state) {
    std::this_thread::sleep_for(50ms);
    answer = client.ask("alive");
  }
  return answer;
}

int stop(const Arguments& arguments) {
  ControlClient client(control_socket(arguments.socket));
  json answer = client.ask("stop");
  if (arguments.wait && answer.value("ok", false)) {
    terminal::Progress progress("ramping down");
    answer = wait_while(client, "stopping");
  }
  return report(arguments, answer, print_state);
}

// Holds the dead-man's handle until it is interrupted.
int start(const Arguments& arguments) {
  if (!arguments.dead_man) return simple(arguments, "start");
  const StopSignals stop_signals;
  ControlClient client(control_socket(arguments.socket));
  json answer = client.ask("start", {{"dead_man", true}});
  const int result = report(arguments, answer, print_state);
  if (result != 0) return result;
  if (!arguments.json_output) {
    terminal::print("holding the dead-man's handle; Ctrl-C stops the rig\n");
  }
  std::fflush(stdout);
  while (!stopped_before(stop_signals, std::chrono::steady_clock::now() + 200ms)) {
    answer = client.ask("alive");
    const std::string state = answer.value("state", "");
    if (state != "running" && state != "stopping") {
      report(arguments, answer, print_state);
      return state == "faulted" ? 1 : 0;
    }
  }
  client.ask("stop");
  return report(arguments, wait_while(client, "stopping"), print_state);
}

int set(const Arguments& arguments) {
  ControlClient client(control_socket(arguments.socket));
  return report(arguments, client.ask("set", {{"key", arguments.key}, {"value", arguments.value}}),
                print_state);
}

void print_average(const json& answer, const Paint&) {
  for (const auto& [stem, raw] : answer.at("average").at("raw").items()) {
    terminal::print("%-18s %.9g +- %.3g raw (one reading), %s\n", stem.c_str(),
                    raw.value("mean", 0.0), raw.value("deviation", 0.0),
                    physics::counted(raw.value("count", std::uint64_t{0}), "reading").c_str());
  }
}

int average(const Arguments& arguments) {
  ControlClient client(control_socket(arguments.socket));
  const auto timeout =
      10s + std::chrono::milliseconds(static_cast<std::int64_t>(arguments.seconds * 1e3));
  terminal::Progress progress("averaging");
  progress.set_duration(arguments.seconds);
  const json answer = client.ask("average", {{"seconds", arguments.seconds}}, timeout);
  progress.finish();
  return report(arguments, answer, print_average);
}

void print_changes(const json& answer, const Paint&) {
  for (const json& line : answer.at("changes"))
    terminal::print("%s\n", line.get<std::string>().c_str());
}

int reload(const Arguments& arguments) {
  ControlClient client(control_socket(arguments.socket));
  return report(arguments, client.ask("reload"), print_changes);
}

void print_watched(const json& line, const Paint& paint) {
  if (const auto event = line.find("event"); event != line.end()) {
    const std::string severity = event->value("severity", "");
    terminal::print("%s %s: %s\n", paint(tone_of_severity(severity), padded(severity, 11)).c_str(),
                    event->value("code", "").c_str(), event->value("message", "").c_str());
  } else if (const auto status = line.find("status"); status != line.end()) {
    const json& drive = line.at("drive");
    const std::string state = line.value("state", "");
    terminal::print(
        "%s %s, amplitude %s at %s Hz%s\n", paint(tone_of_state(state), padded(state, 11)).c_str(),
        physics::counted(status->at("ledger").value("produced", std::uint64_t{0}), "frame").c_str(),
        physics::number_text(drive.value("amplitude", 0.0), 6).c_str(),
        physics::number_text(drive.value("carrier_hz", 0.0), 6).c_str(),
        status->at("timing").value("degraded", false) ? ", timing degraded" : "");
  }
}

int watch(const Arguments& arguments) {
  const StopSignals stop_signals;
  ControlClient client(control_socket(arguments.socket));
  const json answer = client.ask("watch");
  const int result = report(arguments, answer, print_state);
  if (result != 0) return result;
  const auto until = after(std::chrono::steady_clock::now(), arguments.duration_s);
  while (std::chrono::steady_clock::now() < until) {
    if (stopped_before(stop_signals, std::chrono::steady_clock::now())) break;
    if (const auto line = client.next(100ms)) {
      if (arguments.json_output) {
        std::printf("%s\n", line->dump().c_str());
      } else {
        print_watched(*line, paint_of(arguments));
      }
      std::fflush(stdout);
    }
  }
  return 0;
}

void print_note(const json& answer, const Paint&) {
  terminal::print("noted at %.3f s of device time\n", 1e-9 * answer.value("time_ns", 0.0));
}

int note(const Arguments& arguments) {
  std::string text;
  for (const std::string& word : arguments.words) text += (text.empty() ? "" : " ") + word;
  ControlClient client(control_socket(arguments.socket));
  return report(arguments, client.ask("note", {{"text", text}}), print_note);
}

/// A key that the daemon can change while it drives, a live one of the excitation; its table may be
/// left out.
CLI::Validator settable_key() {
  std::vector<std::string> names;
  for (const config::Key& key : config::rig_keys()) {
    if (key.live && key.path.starts_with("excitation.") && key.type == config::Type::number) {
      names.emplace_back(key.path);
    }
  }
  return CLI::Validator(
      [known = one_of(names)](const std::string& text) {
        const std::string table = "excitation.";
        return known(text.starts_with(table) ? text : table + text);
      },
      "");
}

void add_setting(CLI::App& command, Arguments& arguments) {
  command.add_option("KEY", arguments.key, "As in the rig file, such as excitation.carrier_hz")
      ->required()
      ->check(settable_key());
  command.add_option("VALUE", arguments.value, "In the key's unit")
      ->required()
      ->check(finite_number());
}

}  // namespace

void add_ctl(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* ctl = app.add_subcommand("ctl", "Send commands to a running daemon");
  ctl->require_subcommand(1);
  ctl->add_option("--socket", arguments->socket,
                  "The daemon's control socket (default: $STICKSLIP_CONTROL, or "
                  "/run/stickslip/control.sock)")
      ->type_name("FILE");
  add_colour_option(*ctl, arguments->colours);
  add_json_flag(*ctl, arguments->json_output);
  const auto command = [&](const char* name, const char* sentence,
                           std::function<int(const Arguments&)> run) {
    CLI::App* const out = ctl->add_subcommand(name, sentence);
    out->fallthrough();
    out->callback([&action, arguments, run] { action = [=] { return run(*arguments); }; });
    return out;
  };
  command("status", "State, fault, channels, ledger and timing", status);
  for (const auto& [name, sentence] :
       {std::pair{"clear", "Clear a fault after inspecting it; refused while it persists"},
        std::pair{"arm", "Allow a start; refused while an interlock is broken"},
        std::pair{"disarm", "Withdraw that; ramps down if running"}}) {
    command(name, sentence,
            [name = std::string(name)](const Arguments& a) { return simple(a, name); });
  }
  CLI::App* const starting = command("start", "Start the excitation of an armed rig", start);
  starting->add_flag("--dead-man", arguments->dead_man,
                     "Only while this command runs; Ctrl-C stops the rig");
  CLI::App* const stopping = command("stop", "Ramp down and switch the amplifier off", stop);
  stopping->add_flag("--wait", arguments->wait, "Return when the rig is at rest");
  CLI::App* const setting = command("set", "Change the excitation while it runs", set);
  add_setting(*setting, *arguments);
  CLI::App* const averaging = command("average", "Mean of the raw readings", average);
  add_averaging_time_option(*averaging, arguments->seconds);
  add_ctl_calibrate(*ctl, {arguments, &arguments->socket}, action);
  add_ctl_model(*ctl, {arguments, &arguments->socket}, {arguments, &arguments->json_output},
                action);
  command("note", "Write a note with its time into the recording", note)
      ->add_option("TEXT", arguments->words, "One line; its words need no quotes")
      ->required();
  command("reload", "Reload the configuration, as SIGHUP does", reload);
  CLI::App* const watching =
      command("watch", "Print events as they occur, and the status every second", watch);
  add_stop_after_option(*watching, arguments->duration_s);
  describe(
      *ctl,
      {.examples = {{"Show the state of the rig", "stickslip ctl status"},
                    {"Acknowledge a fault", "stickslip ctl clear"},
                    {"Arm the rig", "stickslip ctl arm"},
                    {"Start, and stop when this command ends", "stickslip ctl start --dead-man"},
                    {"Change the excitation while it runs",
                     "stickslip ctl set excitation.carrier_hz 4.2"},
                    {"Take the model that a diagnosis has mended",
                     "stickslip ctl model mended.toml"}},
       .environment = {{"STICKSLIP_CONTROL",
                        "Control socket of the daemon if --socket is not given"},
                       no_color_variable},
       .files = {{"/run/stickslip/control.sock", "The control socket by default"}},
       .see_also = {"stickslipd(8)"}});
}

}  // namespace stickslip::commands
