// SPDX-License-Identifier: Apache-2.0
// Steps that read the bench at rest: identities, noise, shunt, timing.
#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>
#include <string>

#include "physics/number_text.h"
#include "tools/commissioning/commissioning.h"
#include "tools/commissioning/readings.h"
#include "tools/commissioning/resolution.h"

namespace stickslip::commissioning {

namespace {

using physics::number_text;

constexpr double share_of_range = 0.98;      // beyond which a reading is at the end of its range
constexpr std::size_t enough_readings = 50;  // that are all the same, to be suspicious
constexpr double largest_noise_ratio = 5.0;  // to the declared noise
constexpr double shunt_tolerance = 0.02;
constexpr double largest_loss = 0.001;  // share of the frames

std::string stem_of(Channel channel) { return std::string(info(channel).stem); }

/// DEVICE/INPUT of a channel.
std::string source_of(const config::Rig& rig, Channel channel) {
  const auto& input = rig.bench.inputs[index_of(channel)];
  return input ? input->device + "/" + input->input : std::string();
}

/// End of the range of an input [raw]; infinity if unknown.
double range_of(const config::Rig& rig, Channel channel) {
  const auto& input = rig.bench.inputs[index_of(channel)];
  if (!input) return INFINITY;
  if (input->device == "phidget_bridge") return 1.0 / input->gain;
  const bool on_board = input->device == config::name_of(rig.bench.board);
  return on_board ? input->range_v : INFINITY;
}

struct Rest {
  ChannelReadings readings;
  std::uint64_t first = 0;  // sequence
  std::uint64_t last = 0;
  std::uint64_t frames = 0;
  bool contact_on = false;  // at the end
  RunEnd end;
};

Rest read_at_rest(const Bench& bench, double duration_s) {
  Rest out;
  out.end = bench.session.run(duration_s, [&out, &bench](const Moment& moment) {
    if (!moment.frame) return true;
    out.contact_on = bench.session.contact_on(moment.outputs).value_or(false);
    if (out.frames++ == 0) out.first = moment.frame->sequence;
    out.last = moment.frame->sequence;
    add(out.readings, *moment.frame);
    return true;
  });
  return out;
}

/// The fault of a channel at rest, as a sentence; empty: none.
std::string complaint(const config::Rig& rig, Channel channel, const Readings& readings) {
  const std::string who = stem_of(channel) + " from " + source_of(rig, channel);
  if (readings.count() == 0) return "There is no valid reading of " + who + ". ";
  if (std::abs(readings.mean()) > share_of_range * range_of(rig, channel)) {
    return who + " is at the end of its range (" + number_text(readings.mean(), 4) +
           "): an open wire, or too high a gain. ";
  }
  const bool fine = step_of(rig, channel) == 0.0;
  if (fine && readings.count() >= enough_readings && readings.deviation() == 0.0) {
    return "Every reading of " + who + " is " + number_text(readings.mean(), 4) +
           ", without any noise: its wire may be open or shorted. ";
  }
  const auto& declared = rig.model.sensors[index_of(channel)].noise_std;
  const double noise = readings.deviation() * std::abs(rig.calibration[index_of(channel)].gain);
  if (declared && noise > largest_noise_ratio * *declared) {
    return "The noise of " + who + " is " + number_text(noise, 3) + " " +
           std::string(info(channel).unit) + ", and the model declares " +
           number_text(*declared, 3) + ": check screen and ground, with the amplifier's mains on. ";
  }
  return {};
}

void add_zero(const Bench& bench, Channel channel, const Readings& readings, StepRecord& out) {
  const std::string raw(bench.session.description().unit[index_of(channel)]);
  const double gain = std::abs(bench.session.rig().calibration[index_of(channel)].gain);
  const std::string unit(info(channel).unit);
  // Within a step of a coarse input the reading says nothing.
  const double rounding = step_of(bench.session.rig(), channel) / std::sqrt(12.0);
  const double zero_sigma = std::hypot(readings.mean_sigma(), rounding);
  const double noise = std::hypot(readings.deviation(), rounding);
  out.measured.push_back({stem_of(channel) + ".zero_raw", readings.mean(), zero_sigma, raw});
  out.measured.push_back({stem_of(channel) + ".noise_raw", noise, {}, raw});
  out.measured.push_back({stem_of(channel) + ".zero", bench.session.si(channel, readings.mean()),
                          gain * zero_sigma, unit});
  out.measured.push_back({stem_of(channel) + ".noise", gain * noise, {}, unit});
}

/// Resistances of shunt and bridge, "100000 350"; zeros if they are none.
std::array<double, 2> resistances(const std::string& line) {
  std::istringstream in(line);
  std::array<double, 2> out{};
  in >> out[0] >> out[1];
  if (!in || !(out[0] > 0.0) || !(out[1] > 0.0)) return {};
  return out;
}

/// Compares one bridge input with its shunt; adds the numbers and sentences to `out`.
void shunt_one(const Bench& bench, Channel channel, StepRecord& out) {
  const std::string who = stem_of(channel) + " (" + source_of(bench.session.rig(), channel) + ")";
  const std::string line = bench.ask(
      who + ": resistances of shunt and bridge in ohm, as in \"100000 350\"; [Enter]: none: ");
  const auto [shunt_ohm, bridge_ohm] = resistances(line);
  if (shunt_ohm <= 0.0) {
    out.text += who + " was left out. ";
    if (out.verdict == Verdict::passed) out.verdict = Verdict::not_done;
    return;
  }
  const auto mean = [&bench, channel] {
    return read_at_rest(bench, bench.durations.reading_s).readings[index_of(channel)];
  };
  const Readings before = mean();
  static_cast<void>(bench.please("connect the shunt, then [Enter]: "));
  const Readings with = mean();
  static_cast<void>(bench.please("remove the shunt, then [Enter]: "));
  const Readings after = mean();
  const double expected = bridge_ohm / (4.0 * shunt_ohm + 2.0 * bridge_ohm);
  const double step = with.mean() - 0.5 * (before.mean() + after.mean());
  const double ratio = std::abs(step) / expected;
  out.measured.push_back({stem_of(channel) + ".shunt", step, with.mean_sigma(), "V/V"});
  out.measured.push_back({stem_of(channel) + ".shunt_ratio", ratio, {}, "1"});
  out.text += who + " reads " + number_text(ratio, 5) + " of the " + number_text(expected, 4) +
              " V/V of the shunt. ";
  const bool returned = std::abs(after.mean() - before.mean()) < shunt_tolerance * expected;
  if (std::abs(ratio - 1.0) < shunt_tolerance && returned) return;
  out.verdict = Verdict::failed;
  out.remedy = !returned ? "the reading did not return: remove the shunt, let the bridge settle"
                         : "check the resistances, the arm, and inputs." + stem_of(channel) +
                               ".gain; a factor of 2 is another type of bridge";
}

}  // namespace

StepRecord identities(const Bench& bench) {
  const std::string name = bench.session.description().name;
  bench.show("  " + name + "\n");
  if (bench.ask("are these the devices of this bench, by their labels? [Enter]: yes, n: no: ") ==
      "n") {
    return failed("Not the devices of this bench: " + name + ".",
                  "set `serial` of the board and of the bridge, and `port` of the others");
  }
  return passed(name + ".");
}

StepRecord noise(const Bench& bench) {
  const config::Rig& rig = bench.session.rig();
  const Rest rest = read_at_rest(bench, bench.durations.reading_s);
  if (rest.end.outcome != drivers::Outcome::ok) {
    return failed("The bench cannot be read: " + rest.end.message + ".", "stickslip doctor");
  }
  if (rest.contact_on) {
    return failed("The amplifier's enable contact is closed although it was not commanded.",
                  "stay away from the shaker; check active_low of the enable line, and "
                  "[readback.enable]");
  }
  StepRecord out = passed("");
  for (const Channel channel : all_channels) {
    if (!bench.session.measures(channel)) continue;
    const Readings& readings = rest.readings[index_of(channel)];
    const std::string wrong = complaint(rig, channel, readings);
    out.text += wrong;
    if (!wrong.empty()) out.verdict = Verdict::failed;
    if (readings.count() > 0) add_zero(bench, channel, readings, out);
  }
  const auto due = static_cast<double>(rest.last - rest.first + 1);
  const double lost = rest.frames > 0 ? 1.0 - static_cast<double>(rest.frames) / due : 1.0;
  out.measured.push_back({"frames.lost", lost, {}, "1"});
  if (lost > largest_loss) {
    out.verdict = Verdict::failed;
    out.text += number_text(100.0 * lost, 3) + " % of the frames were lost. ";
  }
  if (out.verdict == Verdict::failed) {
    out.remedy = "check the wires named above; stickslip check --live shows every reading";
  } else {
    out.text = "Every channel reads, with the noise below.";
  }
  return out;
}

StepRecord shunt(const Bench& bench) {
  StepRecord out = passed("");
  bool any = false;
  for (const Channel channel : all_channels) {
    const auto& input = bench.session.rig().bench.inputs[index_of(channel)];
    if (!input || input->device != "phidget_bridge") continue;
    any = true;
    shunt_one(bench, channel, out);
  }
  return any ? out : not_applicable("No channel comes from a bridge.");
}

StepRecord timing(const Bench& bench) {
  const config::Rig& rig = bench.session.rig();
  double longest_gap_s = 0.0;
  std::array<double, channel_count> oldest_s{};
  double last_s = -1.0;
  const std::uint64_t losses = bench.session.losses();
  const RunEnd end = bench.session.run(bench.durations.timing_s, [&](const Moment& moment) {
    if (!moment.frame) return true;
    if (last_s >= 0.0) longest_gap_s = std::max(longest_gap_s, moment.time_s - last_s);
    last_s = moment.time_s;
    for (const Channel channel : all_channels) {
      if (!moment.frame->has(channel)) continue;
      double& oldest = oldest_s[index_of(channel)];
      oldest = std::max(oldest, 1e-6 * moment.frame->age_us[index_of(channel)]);
    }
    return true;
  });
  StepRecord out = passed("The longest time between two frames was " +
                          number_text(1e3 * longest_gap_s, 4) + " ms, without real-time priority.");
  out.measured.push_back({"frames.longest_gap", longest_gap_s, {}, "s"});
  for (const Channel channel : all_channels) {
    if (!bench.session.measures(channel)) continue;
    const double oldest = oldest_s[index_of(channel)];
    out.measured.push_back({stem_of(channel) + ".oldest", oldest, {}, "s"});
    if (rig.safety.stale_after_s > 0.0 && oldest > rig.safety.stale_after_s) {
      out.verdict = Verdict::failed;
      out.text += std::string(" ").append(stem_of(channel)) + " was up to " +
                  number_text(oldest, 3) + " s old.";
      out.remedy = "a longer safety.stale_after_s, or a shorter poll period";
    }
  }
  const double lost = static_cast<double>(bench.session.losses() - losses);
  out.measured.push_back({"readings.lost", lost, {}, "1"});
  const double limit_s = rig.safety.longest_overrun_s.value_or(0.05);
  if (limit_s > 0.0 && longest_gap_s > limit_s + 1.0 / rig.loop.rate_hz) {
    out.verdict = Verdict::failed;
    out.text +=
        " That is an overrun (safety.longest_overrun_s is " + number_text(limit_s, 3) + ").";
    out.remedy = "stickslip doctor --config RIG.toml names what delays this machine";
  }
  if (end.outcome == drivers::Outcome::ok) return out;
  return failed("The bench cannot be read: " + end.message + ".", "stickslip doctor");
}

}  // namespace stickslip::commissioning
