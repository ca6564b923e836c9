// SPDX-License-Identifier: Apache-2.0
#include "daemon/interlocks.h"

#include <algorithm>
#include <bit>

namespace stickslip::daemon {
namespace {

using drivers::Outcome;

constexpr double ms_of(std::int64_t ns) { return static_cast<double>(ns) * 1e-6; }

const ChannelInfo& channel_at(int index) { return channel_table[static_cast<std::size_t>(index)]; }

}  // namespace

Interlocks::Interlocks(const InterlockSettings& settings, std::uint8_t channels)
    : settings_(settings), channels_(channels) {}

void Interlocks::update(const drivers::Result& result, std::int64_t now_ns, Silence& silence) {
  switch (result.outcome) {
    case Outcome::ok:
    case Outcome::end_of_data:
      silence = Silence();
      return;
    case Outcome::no_data:
      if (!silence.on) silence = {true, now_ns, Outcome::ok, Cause("the device yields no data")};
      return;
    case Outcome::temporary:
      if (!silence.on) silence.since_ns = now_ns;
      silence.on = true;
      silence.cause = Cause(result.message);
      return;
    case Outcome::needs_attention:
    case Outcome::lost:
    case Outcome::fatal:
      silence = {true, now_ns, result.outcome, Cause(result.message)};
      return;
  }
}

void Interlocks::frame(const Frame& si, std::uint8_t not_finite, std::int64_t now_ns) {
  not_finite_ = settings_.not_finite ? not_finite : std::uint8_t{0};
  out_of_range_ = 0;
  latest_ = si;
  if (!any_frame_) measured_ns_.fill(now_ns);
  any_frame_ = true;
  for (std::size_t i = 0; i < channel_count; ++i) {
    if ((si.valid >> i & 1U) == 0) continue;
    measured_ns_[i] = now_ns - std::int64_t{1000} * si.age_us[i];
    const double value = si.value[i];
    if (value < settings_.range[i].low || value > settings_.range[i].high) {
      out_of_range_ = static_cast<std::uint8_t>(out_of_range_ | (1U << i));
    }
  }
}

void Interlocks::cycle_late(std::int64_t late_ns) {
  const bool too_late = settings_.longest_overrun_ns > 0 && late_ns > settings_.longest_overrun_ns;
  overrun_ns_ = too_late ? late_ns : 0;
}

void Interlocks::device_restored() {
  reads_ = Silence();
  writes_ = Silence();
  signals_ = drivers::Signals();
  not_finite_ = 0;
  out_of_range_ = 0;
  any_frame_ = false;
}

bool Interlocks::silence_broken(const Silence& silence, std::int64_t now_ns, Broken& out) const {
  if (!silence.on) return false;
  if (silence.outcome != Outcome::ok) {
    out = {Interlock::device_lost, silence.cause, silence.outcome};
    return true;
  }
  if (settings_.longest_silence_ns <= 0 ||
      now_ns - silence.since_ns < settings_.longest_silence_ns) {
    return false;
  }
  out = {Interlock::device_silent, silence.cause, Outcome::lost};
  out.cause.add(", for ").add(ms_of(now_ns - silence.since_ns)).add(" ms");
  return true;
}

bool Interlocks::channel_broken(std::int64_t now_ns, Broken& out) const {
  if (not_finite_ != 0) {
    out.interlock = Interlock::not_finite;
    out.cause.add(channel_at(std::countr_zero(not_finite_)).stem).add(" is not a finite number");
    return true;
  }
  if (out_of_range_ != 0) {
    const int i = std::countr_zero(out_of_range_);
    const Range& range = settings_.range[static_cast<std::size_t>(i)];
    const ChannelInfo& channel = channel_at(i);
    out.interlock = Interlock::out_of_range;
    out.cause.add(channel.stem).add(" was ").add(latest_.value[static_cast<std::size_t>(i)]);
    out.cause.add(" ").add(channel.unit).add(", beyond its limits of ").add(range.low);
    out.cause.add(" and ").add(range.high);
    return true;
  }
  if (settings_.stale_after_ns <= 0) return false;
  if (!any_frame_) {
    out.interlock = Interlock::stale_channel;
    out.cause.add("the device has not returned a frame yet");
    return true;
  }
  for (std::size_t i = 0; i < channel_count; ++i) {
    const std::int64_t age_ns = now_ns - measured_ns_[i];
    if ((channels_ >> i & 1U) == 0 || age_ns <= settings_.stale_after_ns) continue;
    out.interlock = Interlock::stale_channel;
    out.cause.add(channel_table[i].stem).add(" was last measured ").add(ms_of(age_ns));
    out.cause.add(" ms ago");
    return true;
  }
  return false;
}

bool Interlocks::output_broken(Broken& out) const {
  const drivers::DifferingOutput& differing = signals_.differing_output;
  if (differing.name == nullptr) return false;
  out.interlock = Interlock::output_differs;
  out.cause.add(differing.name);
  if (differing.unit == nullptr) return true;
  out.cause.add(" reads back as ").add(differing.reading).add(differing.unit);
  out.cause.add(" where ").add(differing.low);
  if (differing.high != differing.low) out.cause.add(" to ").add(differing.high);
  out.cause.add(differing.unit).add(" was commanded: check its wires and those of [readback]");
  return true;
}

Interlocks::Broken Interlocks::device_broken(std::int64_t now_ns) const {
  Broken out;
  if (silence_broken(reads_, now_ns, out)) return out;
  static_cast<void>(silence_broken(writes_, now_ns, out));
  return out;
}

Interlocks::Broken Interlocks::broken(std::int64_t now_ns) const {
  Broken out;
  const auto is = [&out](Interlock interlock, std::string_view words) {
    out.interlock = interlock;
    out.cause = Cause(words);
    return out;
  };
  if (signals_.emergency_stop) {
    return is(Interlock::emergency_stop,
              "the emergency stop is pressed, its wire is cut, or its input does not respond");
  }
  if (signals_.amplifier_fault) {
    return is(Interlock::amplifier_fault, "the amplifier reports a fault");
  }
  out = device_broken(now_ns);
  if (out.interlock != Interlock::none) return out;
  if (output_broken(out)) return out;
  if (signals_.lost_device != nullptr) return is(Interlock::part_lost, signals_.lost_device);
  if (!drive_finite_) return is(Interlock::drive_not_finite, "the drive is not a finite number");
  if (channel_broken(now_ns, out)) return out;
  if (overrun_ns_ > 0) {
    out.interlock = Interlock::overrun;
    out.cause.add("a cycle was ").add(ms_of(overrun_ns_)).add(" ms late");
    return out;
  }
  if (settings_.recorder_failing && recorder_failing_) {
    return is(Interlock::recorder_failing, "the recording is losing frames");
  }
  if (settings_.observer_diverged && observer_restarted_) {
    return is(Interlock::observer_diverged, "the observer diverged");
  }
  if (dead_man_ns_ && settings_.dead_man_ns > 0 && now_ns - *dead_man_ns_ > settings_.dead_man_ns) {
    return is(Interlock::client_gone,
              "the client that holds the dead-man's handle does not respond");
  }
  return out;
}

}  // namespace stickslip::daemon
