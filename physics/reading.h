// Readings that depart from what their declared chain delivers: gains, leaks, drifts, hum, delays,
// limits and a differentiator that rolls off early. One law for all channels (ReadingLaw); an
// effect of the catalogue sets its numbers.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "physics/effects/effect.h"
#include "physics/sensor_chain.h"

namespace stickslip::physics {

/// The longest delay that is remembered [s].
inline constexpr double longest_delay_s = 0.03;

/// What something was over the last longest_delay_s, one value for each step.
template <class Value>
class DelayLine {
 public:
  /// As if it had always been `value`. Allocates.
  void settle(const Value& value, double step_s) {
    step_s_ = step_s;
    latest_ = 0;
    ring_.assign(static_cast<std::size_t>(std::ceil(longest_delay_s / step_s)) + 2, value);
  }
  /// One step on.
  void push(const Value& value) {
    latest_ = (latest_ + 1) % ring_.size();
    ring_[latest_] = value;
  }
  /// What `part` of it was `delay_s` ago, on a straight line between steps; a negative delay looks
  /// ahead along the last slope.
  template <class T, class Part>
  T ago(const T& delay_s, Part&& part) const {
    const std::size_t length = ring_.size();
    const T steps = delay_s / step_s_;
    const double whole =
        std::clamp(std::floor(value_of(steps)), 0.0, static_cast<double>(length) - 2.0);
    const auto back = static_cast<std::size_t>(whole);
    const T& newer = part(ring_[(latest_ + length - back) % length]);
    const T& older = part(ring_[(latest_ + 2 * length - back - 1) % length]);
    T share = steps - whole;
    if (value_of(share) > 1.0) share = T(1.0);
    return newer + (older - newer) * share;
  }

 private:
  std::vector<Value> ring_;
  std::size_t latest_ = 0;
  double step_s_ = 1.0;
};

/// What the faults remember beside the chains.
template <class T>
struct FaultMemory {
  T rolled_off{0.0};  ///< output of the actual differentiator
  T into_differentiator{0.0};
  DelayLine<Readings<T>> past;
};

/// What a channel delivers instead of `value`, but for its delay and what leaks into it.
template <class T>
T misread(const ReadingLaw<T>& law, const T& value, double time_s);

/// What misread() was given, and how fast that goes with the reading.
struct RightedReading {
  double value = 0.0;
  double slope = 1.0;
};

/// Takes the gain and the curvature of misread() back. None of a reading near to where the curve
/// turns back or beyond: there it says little or nothing.
std::optional<RightedReading> put_right(const ReadingLaw<double>& law, double reading);

/// The faults of one rig at one step length. Immutable; `bank` must outlive it.
template <class T>
class ReadingFaults {
 public:
  ReadingFaults(const ReadingLaws<T>& laws, const SensorBank& bank, double step_s);

  /// The memory of faults over chains that have settled. Allocates where there are delays.
  void settle(FaultMemory<T>& memory, const SensorMemory<T>& chains) const;
  /// One step on, after the chains.
  void advance(FaultMemory<T>& memory, const SensorMemory<T>& chains) const;
  /// What is read at `time_s`.
  Readings<T> readings(const FaultMemory<T>& memory, const SensorMemory<T>& chains,
                       double time_s) const;

 private:
  Readings<T> undisturbed(const FaultMemory<T>& memory, const SensorMemory<T>& chains) const;

  ReadingLaws<T> laws_;
  const SensorBank* bank_;
  double step_s_;
  bool rolls_off_ = false;
  T stay_{0.0}, before_{0.0}, after_{0.0};  ///< the roll-off's step
};

}  // namespace stickslip::physics
