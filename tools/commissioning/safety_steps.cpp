// SPDX-License-Identifier: Apache-2.0
// Steps that test what must switch the amplifier off: emergency stop, fault line, plugs, watchdog.
#include <algorithm>
#include <chrono>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "physics/number_text.h"
#include "tools/commissioning/commissioning.h"
#include "tools/commissioning/readings.h"

namespace stickslip::commissioning {

namespace {

using drivers::Outcome;
using physics::number_text;

constexpr double settle_s = 0.3;         // of a line after the start of a run
constexpr double held_s = 0.4;           // before a level counts
constexpr double first_reading_s = 1.5;  // of a device after that

/// Waits until something holds for some time; false: it does not until the end. A busy host may
/// leave a line unread for a moment, in which it counts as active.
bool shows(const Bench& bench, double longest_s, const std::function<bool(const Moment&)>& holds) {
  std::optional<double> since_s;
  bool seen = false;
  bench.session.run(longest_s + held_s, [&](const Moment& moment) {
    const bool now = moment.time_s > settle_s && holds(moment);
    if (!now) since_s.reset();
    if (now && !since_s) since_s = moment.time_s;
    seen = since_s && moment.time_s - *since_s >= held_s;
    return !seen;
  });
  return seen;
}

/// An input that has to be active when something is done to it, and when its wire is cut.
struct Line {
  const char* name;      ///< "the emergency stop"
  const char* activate;  ///< action of the person
  const char* release;
  bool (*active)(const drivers::Signals&);
};

StepRecord tested(const Bench& bench, const Line& line) {
  const std::string name = line.name;
  const double longest_s = bench.durations.response_s;
  const auto active = [&line](const Moment& moment) { return line.active(moment.signals); };
  const auto inactive = [&line](const Moment& moment) { return !line.active(moment.signals); };
  if (!shows(bench, longest_s, inactive)) {
    return failed("The line of " + name + " is active although nothing was done to it.",
                  "release it; check its wire and its supply, and active_low");
  }
  const std::vector<std::pair<const char*, const char*>> ways = {
      {line.activate, line.release},
      {"pull its wire out at the board or the chip", "put the wire back"}};
  for (const auto& [act, undo] : ways) {
    if (!bench.please(std::string(act) + ", then [Enter]; s: cannot be done: ")) {
      return not_done(name + ": \"" + act + "\" was left out.");
    }
    const bool seen = shows(bench, longest_s, active);
    static_cast<void>(bench.please(std::string(undo) + ", then [Enter]: "));
    if (!seen) {
      return failed("The line of " + name + " did not react: " + act + ".",
                    act == line.activate
                        ? "check the number of the line, its wire and active_low"
                        : "a cut wire must read as active: a normally closed contact, and a "
                          "resistor that pulls the line to the active level");
    }
    if (!shows(bench, longest_s, inactive)) {
      return failed("The line of " + name + " stays active: " + undo + ".",
                    "check the contact, or a shorter debounce_s");
    }
  }
  return passed("The line reacts to " + name + " and to a cut wire, and comes back.");
}

bool has_contact(const config::Bench& bench,
                 std::optional<config::GpioLine> config::Amplifier::*line) {
  return bench.amplifier && ((*bench.amplifier).*line).has_value();
}

bool has_alarm(const config::ModbusUnit& unit) {
  const auto& registers = unit.map.registers;
  return std::any_of(registers.begin(), registers.end(),
                     [](const auto& each) { return each.role == config::RegisterRole::alarm; });
}

/// By a line of the board or of the GPIO chip, or by the alarm of a Modbus unit.
bool reports_faults(const config::Bench& bench) {
  const config::LabjackOutput* board = config::output_of(bench);
  return (board && board->amplifier_fault_line) || has_contact(bench, &config::Amplifier::fault) ||
         std::any_of(bench.modbus.begin(), bench.modbus.end(), has_alarm);
}

/// A device that has a plug, and its channels.
struct Plug {
  std::string name;
  std::vector<Channel> channels;
};

std::vector<Plug> plugs_of(const config::Rig& rig) {
  const std::string board(config::name_of(rig.bench.board));
  std::vector<Plug> out = {{board, {}}};
  for (const Channel channel : all_channels) {
    const auto& input = rig.bench.inputs[index_of(channel)];
    if (!input) continue;
    const auto same = [&input](const Plug& each) { return each.name == input->device; };
    auto at = std::find_if(out.begin(), out.end(), same);
    if (at == out.end()) at = out.insert(out.end(), Plug{input->device, {}});
    at->channels.push_back(channel);
  }
  for (const config::ModbusUnit& unit : rig.bench.modbus) {
    const auto same = [&unit](const Plug& each) { return each.name == unit.name; };
    if (has_alarm(unit) && std::none_of(out.begin(), out.end(), same))
      out.push_back({unit.name, {}});
  }
  if (rig.bench.amplifier) out.push_back({"GPIO chip " + rig.bench.amplifier->chip, {}});
  return out;
}

/// Time from the last reading of the device to the sign that it is lost; none: there was none.
std::optional<double> time_of_loss(const Bench& bench, const Plug& plug) {
  std::optional<double> found_s;
  double last_s = 0.0;
  const double stale_s = bench.session.rig().safety.stale_after_s;
  const RunEnd end = bench.session.run(bench.durations.response_s, [&](const Moment& moment) {
    const bool reads =
        moment.frame &&
        std::all_of(plug.channels.begin(), plug.channels.end(),
                    [&moment, stale_s](Channel channel) {
                      const double age_s = 1e-6 * moment.frame->age_us[index_of(channel)];
                      return moment.frame->has(channel) && (stale_s <= 0.0 || age_s < stale_s);
                    });
    if (reads && !plug.channels.empty()) last_s = moment.time_s;
    const bool lost = moment.signals.lost_device != nullptr ||
                      (moment.frame && !reads && moment.time_s - last_s > first_reading_s);
    if (lost) found_s = moment.time_s - last_s;
    return !found_s;
  });
  if (end.outcome == Outcome::ok) return found_s;
  return found_s.value_or(0.0);
}

/// True once every channel reads and no device is lost.
bool comes_back(const Bench& bench, std::string& problem) {
  using std::chrono::steady_clock;
  const auto until =
      steady_clock::now() + std::chrono::duration_cast<steady_clock::duration>(
                                std::chrono::duration<double>(bench.durations.return_s));
  while (steady_clock::now() < until) {
    problem = bench.session.open();
    bool complete = false;
    const auto whole = [&bench, &complete](const Moment& moment) {
      if (moment.signals.lost_device != nullptr) return false;
      if (moment.frame) complete = moment.frame->valid == bench.session.description().channels;
      return complete;
    };
    if (problem.empty() && shows(bench, 2.0, whole)) return true;
    bench.session.wait(0.1);
  }
  return false;
}

bool pulled(const Bench& bench, const Plug& plug, StepRecord& out) {
  if (!bench.please("unplug " + plug.name + ", then [Enter]; s leaves it out: ")) {
    out.text += plug.name + " was left out. ";
    if (out.verdict == Verdict::passed) out.verdict = Verdict::not_done;
    return false;
  }
  const std::optional<double> loss_s = time_of_loss(bench, plug);
  static_cast<void>(bench.please("plug " + plug.name + " in again, then [Enter]: "));
  if (!loss_s) {
    out.verdict = Verdict::failed;
    out.text += "The loss of " + plug.name + " was not noticed. ";
    out.remedy = "was it that device? A unit that is read by another one's cable has no plug";
  } else {
    out.measured.push_back({plug.name + ".loss", *loss_s, {}, "s"});
  }
  return true;
}

/// Watches the enable contact while nothing is written; seconds until it opened. None: it did not.
std::optional<double> silence(const Bench& bench, double longest_s, bool& was_on) {
  constexpr double on_s = 1.5;  // before the silence
  std::optional<double> opened_s;
  const bool read_back = bench.session.rig().bench.readback.enable.has_value();
  const auto on = [&bench](const Moment& moment) {
    return bench.session.contact_on(moment.outputs).value_or(false);
  };
  bench.session.run(
      on_s + longest_s,
      [&](const Moment& moment) {
        if (!read_back || !moment.frame) return true;
        if (moment.time_s < on_s) {
          was_on = on(moment);
        } else if (was_on && !on(moment)) {
          opened_s = moment.time_s - on_s;
        }
        return !opened_s && (moment.time_s < on_s || was_on);
      },
      [](double time_s) -> std::optional<drivers::Actuation> {
        if (time_s > on_s) return std::nullopt;
        return drivers::Actuation{0.0, time_s > settle_s};
      });
  return opened_s;
}

/// Without an input that reads the contact, the person is asked.
StepRecord by_the_person(const Bench& bench, double limit_s) {
  if (bench.ask("did the amplifier switch off by itself within " + number_text(limit_s, 3) +
                " s, before the end of this step? y/n: ") == "y") {
    return passed("The amplifier was seen to switch off by itself within " +
                  number_text(limit_s, 3) + " s.");
  }
  return failed("The amplifier was not switched off by any device.",
                "check watchdog_s and enable_line, or the watchdog relay and its heartbeat");
}

}  // namespace

StepRecord emergency_stop(const Bench& bench) {
  const config::Bench& wired = bench.session.rig().bench;
  const config::LabjackOutput* board = config::output_of(wired);
  if (!(board && board->emergency_stop_line) &&
      !has_contact(wired, &config::Amplifier::emergency_stop)) {
    return not_applicable("No emergency stop reports to the daemon.");
  }
  return tested(bench, {"the emergency stop", "press the emergency stop", "release the button",
                        [](const drivers::Signals& now) { return now.emergency_stop; }});
}

StepRecord amplifier_fault(const Bench& bench) {
  const config::Bench& wired = bench.session.rig().bench;
  if (!reports_faults(wired)) {
    return not_applicable("The amplifier does not report its faults to the daemon.");
  }
  return tested(bench, {"the amplifier's fault", "make the amplifier report a fault",
                        "end the amplifier's fault",
                        [](const drivers::Signals& now) { return now.amplifier_fault; }});
}

StepRecord plugs(const Bench& bench) {
  StepRecord out = passed("");
  for (const Plug& plug : plugs_of(bench.session.rig())) {
    if (!pulled(bench, plug, out)) continue;
    std::string problem;
    if (comes_back(bench, problem)) continue;
    out.verdict = Verdict::failed;
    out.text += plug.name + " did not come back" + (problem.empty() ? "" : ": " + problem) + ". ";
    out.remedy = "plug it in again; stickslip check --live says what is missing";
  }
  if (out.verdict == Verdict::passed)
    out.text = "Every loss was noticed, and every device came back.";
  return out;
}

StepRecord watchdog(const Bench& bench) {
  const config::Bench& wired = bench.session.rig().bench;
  const config::LabjackOutput* board = config::output_of(wired);
  const bool in_board = board && board->has_watchdog();
  const double limit_s = in_board ? board->watchdog_s + 1.0 : 3.0;
  bool was_on = false;
  const std::optional<double> opened_s = silence(bench, limit_s + 1.0, was_on);
  if (!wired.readback.enable) return by_the_person(bench, limit_s);
  if (!was_on) {
    return failed("The amplifier's enable contact did not close.",
                  "check its wires, [readback.enable] and on_above_v; is the emergency stop "
                  "released?");
  }
  const std::string who = in_board ? "the watchdog of the board" : "the watchdog relay";
  if (!opened_s) {
    return failed("The enable contact stayed closed for " + number_text(limit_s + 1.0, 3) +
                      " s without a command: no device switched the amplifier off.",
                  "check " + who + " and its wires; do not run this bench");
  }
  StepRecord out = passed("After " + number_text(*opened_s, 3) +
                          " s without a command the contact opened, by " + who + ".");
  out.measured.push_back({"watchdog.time", *opened_s, {}, "s"});
  if (*opened_s <= limit_s) return out;
  out.verdict = Verdict::failed;
  out.remedy = "a shorter time of " + who;
  return out;
}

}  // namespace stickslip::commissioning
