// SPDX-License-Identifier: Apache-2.0
// Steps in which something moves: polarity and delays by hand, and the drive at 1 %.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "physics/number_text.h"
#include "tools/commissioning/commissioning.h"
#include "tools/commissioning/delay_fit.h"
#include "tools/commissioning/readings.h"
#include "tools/commissioning/resolution.h"
#include "tools/commissioning/sine_fit.h"

namespace stickslip::commissioning {

namespace {

using physics::number_text;

constexpr double clear_response = 8.0;  // standard deviations at rest
constexpr double clear_steps = 3.0;     // or steps of a coarse input
constexpr int readings_in_a_row = 3;    // beyond that
constexpr double longest_delay_s = 0.1;
constexpr double largest_model_delay_s = 0.03;  // sensors.CHANNEL.delay_s
constexpr double least_explained = 0.9;
constexpr double share_of_limit = 0.01;
constexpr double ramp_s = 0.5;
constexpr double amplitude_tolerance = 0.15;

std::string stem_of(Channel channel) { return std::string(info(channel).stem); }

const char* push_of(Channel channel) {
  switch (channel) {
    case Channel::displacement:
      return "push the mass towards +x";
    case Channel::velocity:
      return "push the mass quickly towards +x";
    case Channel::friction_force:
      return "drag the pads towards +x, as the mass does";
    case Channel::normal_load:
      return "press the pads against the mass";
    case Channel::base_displacement:
      return "push the base towards +x";
    case Channel::drive_force:
      return "push the mass towards +x where its drive is measured";
  }
  return "";
}

/// First clear excursion of each channel from rest: its sign, or 0.
using Responses = std::array<int, channel_count>;

Responses responses(const Bench& bench, const ChannelReadings& rest, Channel wanted) {
  Responses out{};
  std::array<int, channel_count> in_a_row{};
  std::array<std::int64_t, channel_count> last_ns{};
  bench.session.run(bench.durations.response_s, [&](const Moment& moment) {
    if (!moment.frame) return true;
    for (const Channel channel : all_channels) {
      const std::size_t i = index_of(channel);
      if (!moment.frame->has(channel) || measured_ns(*moment.frame, channel) == last_ns[i])
        continue;
      last_ns[i] = measured_ns(*moment.frame, channel);
      const double away = (*moment.frame)[channel] - rest[i].mean();
      const double least = std::max(clear_response * rest[i].deviation(),
                                    clear_steps * step_of(bench.session.rig(), channel));
      const int sign = std::abs(away) <= least ? 0 : away > 0 ? 1 : -1;
      in_a_row[i] = sign == 0 ? 0 : in_a_row[i] * sign >= 0 ? in_a_row[i] + sign : sign;
      if (out[i] == 0 && std::abs(in_a_row[i]) >= readings_in_a_row) out[i] = sign;
    }
    return out[index_of(wanted)] == 0;
  });
  return out;
}

/// Adds what is wrong with the response of a channel to `out`.
void judge(const Bench& bench, Channel channel, const Responses& found, StepRecord& out) {
  const double gain = bench.session.rig().calibration[index_of(channel)].gain;
  const int sign = found[index_of(channel)] * (gain < 0.0 ? -1 : 1);
  if (sign > 0) return;
  out.verdict = Verdict::failed;
  if (sign < 0) {
    out.text += stem_of(channel) + " fell. ";
    out.remedy = "reverse the sign of calibration." + stem_of(channel) +
                 ".gain, or exchange the wires of its sensor";
    return;
  }
  out.text += stem_of(channel) + " did not respond. ";
  out.remedy = "check its sensor, and inputs." + stem_of(channel) + ".from";
  for (const Channel other : all_channels) {
    if (other == channel || found[index_of(other)] == 0) continue;
    out.text += stem_of(other) + " did. ";
    out.remedy = "are the wires of these channels exchanged?";
  }
}

using Series = std::array<TimedReadings, channel_count>;

/// Readings of all channels [SI] at their own times, and the largest uncertainty of those times.
Series moved_by_hand(const Bench& bench, std::array<double, channel_count>& time_sigma_s) {
  Series out;
  std::array<std::int64_t, channel_count> last_ns{};
  std::int64_t begin_ns = 0;
  bench.session.run(bench.durations.motion_s, [&](const Moment& moment) {
    if (!moment.frame) return true;
    if (begin_ns == 0) begin_ns = moment.frame->time_ns;
    for (const Channel channel : all_channels) {
      const std::size_t i = index_of(channel);
      const std::int64_t at_ns = measured_ns(*moment.frame, channel);
      if (!moment.frame->has(channel) || at_ns <= last_ns[i] + 2000) continue;
      last_ns[i] = at_ns;
      out[i].time_s.push_back(1e-9 * static_cast<double>(at_ns - begin_ns));
      out[i].value.push_back(bench.session.si(channel, (*moment.frame)[channel]));
      time_sigma_s[i] = std::max(time_sigma_s[i], 1e-6 * moment.age_sigma_us[i]);
    }
    return true;
  });
  return out;
}

/// Delay of a chain of filters at low frequencies [s].
double filter_delay_s(const physics::Sensor& sensor) {
  double all = 0.0;
  for (const physics::Filter& filter : sensor.filters) {
    const double order =
        filter.kind == physics::FilterKind::butterworth_lowpass ? filter.order : 1.0;
    all += 1.0 / (2.0 * std::numbers::pi * filter.cutoff_hz.value *
                  std::sin(std::numbers::pi / (2.0 * order)));
  }
  return all;
}

/// Of the channel beyond that of the displacement. The velocity's chain continues it.
double declared_filters_s(const physics::Model& model, Channel channel) {
  const double own = filter_delay_s(model.sensors[index_of(channel)]);
  if (channel == Channel::velocity) return own;
  return own - filter_delay_s(model.sensors[index_of(Channel::displacement)]);
}

void add_delay(const Bench& bench, Channel channel, const Series& series, double time_sigma_s,
               StepRecord& out) {
  const auto delay =
      delay_of(series[index_of(channel)], series[index_of(Channel::displacement)],
               channel == Channel::velocity ? Follows::rate : Follows::value, longest_delay_s);
  if (!delay || delay->explained < least_explained) {
    out.text += stem_of(channel) + " does not follow the mass: its delay is unknown. ";
    return;
  }
  const double beyond_s = delay->delay_s - declared_filters_s(bench.session.rig().model, channel);
  const double sigma_s = std::hypot(delay->sigma_s, time_sigma_s);
  out.measured.push_back({stem_of(channel) + ".delay_s", beyond_s, sigma_s, "s"});
  out.text += stem_of(channel) + " is " + number_text(1e3 * beyond_s, 3) + " ms +- " +
              number_text(1e3 * sigma_s, 2) + " ms late. ";
  if (std::abs(beyond_s) <= largest_model_delay_s) return;
  out.verdict = Verdict::failed;
  out.text += "A model takes up to " + number_text(1e3 * largest_model_delay_s, 3) + " ms. ";
  out.remedy = "a shorter interval or poll period of " + stem_of(channel) +
               ", or a slow filter in its instrument";
}

struct DriveRun {
  std::vector<double> command_s, command;
  std::vector<double> time_s, drive_v;
  std::vector<double> base_s, base;
  bool enabled = false;
  std::string stopped;  ///< why it ended early
};

/// The amplitude at a time: up, held, and down.
double envelope(double time_s, double held_s) {
  const double rising = time_s / ramp_s;
  const double falling = (2.0 * ramp_s + held_s - time_s) / ramp_s;
  return std::clamp(std::min(rising, falling), 0.0, 1.0);
}

std::string reason_to_stop(const drivers::Signals& signals) {
  // The lines of a lost device count as active.
  if (signals.lost_device != nullptr) return signals.lost_device;
  if (signals.emergency_stop) return "the emergency stop is pressed";
  if (signals.amplifier_fault) return "the amplifier reports a fault";
  return {};
}

DriveRun driven(const Bench& bench, double amplitude, double frequency_hz) {
  DriveRun out;
  const config::Rig& rig = bench.session.rig();
  const double held_s = bench.durations.drive_s;
  const Channel base = rig.model.oscillator.excitation == physics::Excitation::force
                           ? Channel::drive_force
                           : Channel::base_displacement;
  constexpr double begin_s = 0.5;  // of the amplifier, after that of the run
  const RunEnd end = bench.session.run(
      begin_s + 2.0 * ramp_s + held_s + 0.5,
      [&](const Moment& moment) {
        if (moment.time_s > begin_s) out.stopped = reason_to_stop(moment.signals);
        const double since_s = moment.time_s - begin_s;
        const bool full = since_s > 1.2 * ramp_s && since_s < ramp_s + held_s;
        if (!moment.frame || !full) return out.stopped.empty();
        if (moment.outputs.drive_v) {
          out.time_s.push_back(since_s);
          out.drive_v.push_back(*moment.outputs.drive_v);
        }
        out.enabled = bench.session.contact_on(moment.outputs).value_or(out.enabled);
        if (moment.frame->has(base)) {
          out.base_s.push_back(since_s - 1e-6 * moment.frame->age_us[index_of(base)]);
          out.base.push_back(bench.session.si(base, (*moment.frame)[base]));
        }
        return out.stopped.empty();
      },
      [&](double time_s) -> std::optional<drivers::Actuation> {
        const double since_s = time_s - begin_s;
        const double size = amplitude * envelope(since_s, held_s);
        const double angle = 2.0 * std::numbers::pi * frequency_hz * since_s;
        return drivers::Actuation{size * std::sin(angle), size > 0.0};
      });
  if (out.stopped.empty() && end.outcome != drivers::Outcome::ok) out.stopped = end.message;
  return out;
}

/// By the input that reads the output back.
void judge_readback(const Bench& bench, const DriveRun& run, double amplitude, double hz,
                    StepRecord& out) {
  const config::Bench& wired = bench.session.rig().bench;
  const double expected =
      amplitude * std::abs(wired.shaker.volts_per_unit * wired.readback.drive->gain);
  const Sine read = sine_of(run.time_s, run.drive_v, hz);
  out.measured.push_back({"drive.readback", read.amplitude, read.amplitude_sigma, "V"});
  out.measured.push_back({"drive.readback_expected", expected, {}, "V"});
  out.text += "The output reads back with " + number_text(read.amplitude, 3) + " V of " +
              number_text(expected, 3) + " V. ";
  if (std::abs(read.amplitude / expected - 1.0) < amplitude_tolerance) return;
  out.verdict = Verdict::failed;
  out.remedy = "check the output, its wire to the spare input, and readback.drive.gain";
}

void judge_base(const DriveRun& run, double amplitude, double hz, StepRecord& out) {
  const Sine moved = sine_of(run.base_s, run.base, hz);
  out.measured.push_back({"drive.response", moved.amplitude, moved.amplitude_sigma, "SI"});
  out.text += "What is driven moves by " + number_text(moved.amplitude, 3) + " of the commanded " +
              number_text(amplitude, 3) + ". ";
  if (moved.amplitude < 3.0 * moved.amplitude_sigma || moved.amplitude < 0.3 * amplitude) {
    out.verdict = Verdict::failed;
    out.remedy = "is the amplifier on, and its gain up? Check shaker.volts_per_unit";
  } else if (moved.amplitude > 3.0 * amplitude) {
    out.verdict = Verdict::failed;
    out.remedy = "the amplifier's gain is too high for shaker.volts_per_unit: turn it down";
  } else if (std::cos(moved.phase) < 0.0) {
    out.verdict = Verdict::failed;
    out.text += "It moves the other way. ";
    out.remedy = "reverse the sign of shaker.volts_per_unit, or the wires of the shaker";
  }
}

}  // namespace

StepRecord polarity(const Bench& bench) {
  ChannelReadings rest;
  bench.session.run(1.0, [&rest](const Moment& moment) {
    if (moment.frame) add(rest, *moment.frame);
    return true;
  });
  StepRecord out = passed("");
  for (const Channel channel : all_channels) {
    if (!bench.session.measures(channel)) continue;
    if (!bench.please(stem_of(channel) + ": [Enter], and then within " +
                      number_text(bench.durations.response_s, 3) + " s " + push_of(channel) +
                      "; s leaves it out: ")) {
      out.text += stem_of(channel) + " was left out. ";
      if (out.verdict == Verdict::passed) out.verdict = Verdict::not_done;
      continue;
    }
    judge(bench, channel, responses(bench, rest, channel), out);
  }
  if (out.verdict == Verdict::passed) out.text = "Every channel responds, and rises.";
  return out;
}

StepRecord delays(const Bench& bench) {
  if (!bench.session.measures(Channel::displacement)) {
    return not_applicable("No displacement is measured, against which delays could be.");
  }
  if (!bench.please("[Enter], and then move the mass to and fro by hand for " +
                    number_text(bench.durations.motion_s, 3) +
                    " s, slowly and quickly, together with what else is measured: ")) {
    return not_done("Left out by the person.");
  }
  std::array<double, channel_count> time_sigma_s{};
  const Series series = moved_by_hand(bench, time_sigma_s);
  StepRecord out = passed("");
  for (const Channel channel : all_channels) {
    if (channel == Channel::displacement || !bench.session.measures(channel)) continue;
    add_delay(bench, channel, series, time_sigma_s[index_of(channel)], out);
  }
  if (!out.measured.empty() || out.verdict == Verdict::failed) return out;
  return failed("No channel follows the mass. " + out.text,
                "was the mass moved? Move it farther, by many times the noise");
}

StepRecord drive(const Bench& bench) {
  const config::Rig& rig = bench.session.rig();
  const bool force = rig.model.oscillator.excitation == physics::Excitation::force;
  const double amplitude =
      share_of_limit * (force ? rig.limits.force_n : rig.limits.displacement_m);
  const double hz = rig.excitation.carrier_hz;
  if (bench.ask("the drive will be " + number_text(amplitude, 3) + (force ? " N" : " m") + " at " +
                    number_text(hz, 3) + " Hz for " +
                    number_text(bench.durations.drive_s + 1.0, 3) + " s; \"yes\" starts it: ",
                "yes") != "yes") {
    return not_done("Not confirmed with \"yes\".");
  }
  const DriveRun run = driven(bench, amplitude, hz);
  if (!run.stopped.empty()) {
    return failed("The drive was stopped: " + run.stopped + ".", "as the earlier steps say");
  }
  StepRecord out = passed("");
  const bool contact = rig.bench.readback.enable.has_value();
  if (contact && !run.enabled) {
    return failed("The amplifier's enable contact did not close.",
                  "check the enable line and [readback.enable]");
  }
  constexpr std::size_t enough = 20;
  if (run.time_s.size() > enough) judge_readback(bench, run, amplitude, hz, out);
  if (run.base.size() > enough) judge_base(run, amplitude, hz, out);
  if (!out.text.empty()) return out;
  return not_done("Nothing measures the drive: neither [readback.drive] nor its channel.");
}

}  // namespace stickslip::commissioning
