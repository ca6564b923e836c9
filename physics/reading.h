// SPDX-License-Identifier: Apache-2.0
// Sensor errors: departures of readings from the output of their declared chains (gain, crosstalk,
// drift, hum, delay, saturation, a characteristic, a differentiator with a low cut-off). One law
// for all channels (ReadingLaw), whose numbers the effects of the catalogue set.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "physics/effect.h"
#include "physics/sensor_chain.h"

namespace stickslip::physics {

/// The longest delay that is simulated [s].
inline constexpr double longest_delay_s = 0.03;

/// The values of the last longest_delay_s, one for each step.
template <class Value>
class DelayLine {
 public:
  /// Fills the line with `value`. Allocates.
  void settle(const Value& value, double step_s) {
    step_s_ = step_s;
    latest_ = 0;
    ring_.assign(static_cast<std::size_t>(std::ceil(longest_delay_s / step_s)) + 2, value);
  }
  /// Appends the value of the next step.
  void push(const Value& value) {
    latest_ = (latest_ + 1) % ring_.size();
    ring_[latest_] = value;
  }
  /// `part` of the value `delay_s` ago, interpolated linearly between steps; a negative delay
  /// extrapolates the last slope.
  template <class T, class Part>
  T delayed(const T& delay_s, Part&& part) const {
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

/// State of the sensor errors, in addition to that of the chains.
template <class T>
struct SensorErrorState {
  T rolled_off{0.0};  ///< output of the actual differentiator
  T into_differentiator{0.0};
  DelayLine<Readings<T>> past;
};

/// The reading of a channel for a true value `value`, without its delay and crosstalk.
template <class T>
T reading_of(const ReadingLaw<T>& law, const T& value, double time_s);

/// A corrected reading and its derivative with respect to the reading.
struct CorrectedReading {
  double value = 0.0;
  double slope = 1.0;
};

/// Inverts gain, curvature and characteristic of reading_of(). Empty where the law is too flat to
/// be inverted: at less than a quarter of its nominal slope, or beyond its turning point.
std::optional<CorrectedReading> correct_reading(const ReadingLaw<double>& law, double reading);

/// The sensor errors of one rig at one step length. Immutable; `bank` must outlive it.
template <class T>
class SensorErrors {
 public:
  SensorErrors(const ReadingLaws<T>& laws, const SensorBank& bank, double step_s);

  /// Steady state for chains in steady state. Allocates where there are delays.
  void settle(SensorErrorState<T>& memory, const SensorMemory<T>& chains) const;
  /// Advances by one step, after the chains.
  void advance(SensorErrorState<T>& memory, const SensorMemory<T>& chains) const;
  /// The readings at `time_s`.
  Readings<T> readings(const SensorErrorState<T>& memory, const SensorMemory<T>& chains,
                       double time_s) const;

 private:
  Readings<T> rolled_off_readings(const SensorErrorState<T>& memory,
                                  const SensorMemory<T>& chains) const;

  ReadingLaws<T> laws_;
  const SensorBank* bank_;
  double step_s_;
  bool rolls_off_ = false;
  T stay_{0.0}, before_{0.0}, after_{0.0};  ///< step response of the roll-off
};

}  // namespace stickslip::physics
