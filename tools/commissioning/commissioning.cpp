// SPDX-License-Identifier: Apache-2.0
#include "tools/commissioning/commissioning.h"

#include <algorithm>
#include <array>
#include <utility>

#include "config/settings.h"
#include "diagnosis/shooting.h"
#include "tools/files/utc_now.h"

namespace stickslip::commissioning {

namespace {

constexpr std::array steps = {
    Step{"identities", "Identities of the devices",
         "All devices are opened and name themselves. Nothing moves, and the amplifier stays off "
         "until the last two steps.",
         identities},
    Step{"noise", "Zero and noise", "Keep your hands off the bench: every channel is read at rest.",
         noise},
    Step{"shunt", "Shunt calibration of the bridges",
         "A known resistor across an arm of a bridge makes a known reading.", shunt},
    Step{"polarity", "Polarity",
         "Each channel is moved by hand in its positive direction: it must respond, and rise.",
         polarity},
    Step{"delays", "Delays between channels",
         "The mass is moved to and fro by hand; how late is each channel against the displacement?",
         delays},
    Step{"emergency_stop", "Emergency stop",
         "The button and the wire that reports it to the daemon.", emergency_stop},
    Step{"amplifier_fault", "Fault line of the amplifier",
         "The contact by which the amplifier reports a fault.", amplifier_fault},
    Step{"plugs", "Loss of each plug",
         "Every device is unplugged once: its loss must be noticed, and it must come back.", plugs},
    Step{"timing", "Times of the loop",
         "Read and write as the daemon does, with the amplifier off; the longest times count.",
         timing},
    Step{"watchdog", "Watchdog",
         "THE AMPLIFIER IS SWITCHED ON with its drive at rest, and then this program falls "
         "silent: who switches it off, and after how long? Keep clear of the shaker.",
         watchdog},
    Step{"drive", "Drive at 1 %",
         "THE SHAKER MOVES, by 1 % of its limit. Keep clear, and a hand on the emergency stop.",
         drive},
};

std::string answered(std::string line) {
  while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.pop_back();
  return line;
}

void show_result(const Bench& bench, const StepRecord& found) {
  std::string text = "  ";
  text.append(name_of(found.verdict)).append(": ").append(found.text).append("\n");
  if (!found.remedy.empty()) text += "  what to do: " + found.remedy + "\n";
  bench.show(text);
}

StepRecord made_once(const Bench& bench, const Step& step) {
  const std::string problem = bench.session.open();
  StepRecord found = problem.empty() ? step.run(bench)
                                     : failed("A device cannot be used: " + problem + ".",
                                              "stickslip devices, stickslip check --live");
  if (const std::string on = bench.session.left_on(); !on.empty()) {
    found = failed("The amplifier may still be on: " + on + ".", "press the emergency stop");
  }
  return found;
}

/// Once, or as often as the person repeats it; `put` takes each result.
void make(const Bench& bench, const Step& step, const std::function<void(StepRecord)>& put) {
  std::string opening = "\n";
  opening.append(step.title).append(" (").append(step.id).append(")\n").append(step.text);
  bench.show(opening.append("\n"));
  if (!bench.please("[Enter] begins, s leaves this step out, q ends: ")) {
    return put(not_done("Left out by the person."));
  }
  for (;;) {
    StepRecord found = not_done("Interrupted.");
    try {
      found = made_once(bench, step);
    } catch (...) {
      put(found);
      throw;
    }
    show_result(bench, found);
    put(found);
    if (found.verdict != Verdict::failed) return;
    if (bench.ask("r repeats it, [Enter] goes on, q ends: ") != "r") return;
  }
}

bool wanted(const Step& step, const Record& record, const Choice& choice) {
  if (!choice.only.empty()) {
    return std::find(choice.only.begin(), choice.only.end(), step.id) != choice.only.end();
  }
  const StepRecord* before = record.find(step.id);
  return before == nullptr || before->verdict == Verdict::failed ||
         before->verdict == Verdict::not_done;
}

bool complete(const Record& record) {
  return std::all_of(steps.begin(), steps.end(), [&record](const Step& step) {
    const StepRecord* found = record.find(step.id);
    return found != nullptr &&
           (found->verdict == Verdict::passed || found->verdict == Verdict::not_applicable);
  });
}

}  // namespace

std::span<const Step> all_steps() { return steps; }

StepRecord passed(std::string text) { return {"", Verdict::passed, "", std::move(text), "", {}}; }

StepRecord failed(std::string text, std::string remedy) {
  return {"", Verdict::failed, "", std::move(text), std::move(remedy), {}};
}

StepRecord not_done(std::string text) {
  return {"", Verdict::not_done, "", std::move(text), "", {}};
}

StepRecord not_applicable(std::string text) {
  return {"", Verdict::not_applicable, "", std::move(text), "", {}};
}

std::string Bench::ask(const std::string& question, const std::string& agreed) const {
  const std::optional<std::string> line = person.ask(question, agreed);
  if (!line || answered(*line) == "q") throw Ended();
  return answered(*line);
}

bool Bench::please(const std::string& what) const { return ask(what) != "s"; }

std::vector<std::pair<std::string, std::string>> bench_settings(const config::Rig& rig) {
  std::vector<std::pair<std::string, std::string>> out;
  for (const config::Setting& each : config::settings_of(rig)) {
    const std::string table = each.path.substr(0, each.path.find('.'));
    constexpr std::array tables = {"inputs",          "shaker",         "labjack_u6", "labjack_t7",
                                   "usb_1208fs_plus", "phidget_bridge", "modbus",     "gauge",
                                   "amplifier",       "readback"};
    const bool of_bench = std::find(tables.begin(), tables.end(), table) != tables.end();
    if (!of_bench && each.path != "driver.bench.board" && each.path != "loop.rate_hz") continue;
    if (each.value.empty()) continue;
    out.emplace_back(each.path, each.value);
  }
  // A calibration changes numbers, but not the direction that the polarity has shown.
  for (const Channel channel : all_channels) {
    if (!rig.bench.inputs[index_of(channel)]) continue;
    const bool negative = rig.calibration[index_of(channel)].gain < 0.0;
    out.emplace_back("calibration." + std::string(info(channel).stem) + ".gain",
                     negative ? "negative" : "positive");
  }
  return out;
}

bool commission(BenchSession& session, const Person& person, Record& record, const Choice& choice,
                const Durations& durations, const std::function<void(const Record&)>& keep) {
  const Bench bench{session, person, durations};
  const auto put = [&](const Step& step, StepRecord found) {
    if (step.run == identities && found.verdict == Verdict::passed) {
      record.devices = session.description().name;
    }
    found.step = step.id;
    found.date = files::utc_now();
    const StepRecord* before = record.find(step.id);
    const bool was_passed = before != nullptr && before->verdict == Verdict::passed;
    if (was_passed && found.verdict == Verdict::not_done) return;  // not repeated after all
    record.put(std::move(found));
    keep(record);
  };
  try {
    for (const Step& step : steps) {
      if (!wanted(step, record, choice)) continue;
      make(bench, step, [&](StepRecord found) { put(step, std::move(found)); });
    }
  } catch (const Ended&) {
    session.close();
  }
  keep(record);
  return complete(record);
}

}  // namespace stickslip::commissioning
