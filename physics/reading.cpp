// SPDX-License-Identifier: Apache-2.0
#include "physics/reading.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace stickslip::physics {

namespace {

using std::numbers::pi;

template <class AnyReadings>
auto& channel_of(AnyReadings& readings, Channel channel) {
  switch (channel) {
    case Channel::velocity:
      return readings.velocity;
    case Channel::friction_force:
      return readings.friction_force;
    case Channel::normal_load:
      return readings.normal_load;
    default:
      return readings.displacement;
  }
}

constexpr std::array read_channels = {Channel::displacement, Channel::velocity,
                                      Channel::friction_force, Channel::normal_load};

// The drift at `time_s`, divided by its initial rate.
template <class T>
T drifted_s(const ReadingLaw<T>& law, double time_s) {
  using std::exp;
  if (time_s < 1.0e-8 * value_of(law.drift_time_constant_s)) return T(time_s);
  return law.drift_time_constant_s * (1.0 - exp(-time_s / law.drift_time_constant_s));
}

}  // namespace

template <class T>
T reading_of(const ReadingLaw<T>& law, const T& value, double time_s) {
  using std::sin;
  T out = law.gain * value;
  out += law.curvature * out * out;
  if (law.characteristic != nullptr) {
    law.characteristic->distort(out, law.characteristic_parameters.data());
  }
  out += law.offset + law.drift_per_s * drifted_s(law, time_s);
  if (value_of(law.hum_frequency_hz) > 0.0) {
    T share(1.0);
    for (std::size_t i = 0; i < law.hum_modulation.size(); i += 2) {
      const double angle = pi * static_cast<double>(i + 2) * time_s / law.hum_modulation_s;
      share +=
          law.hum_modulation[i] * std::cos(angle) + law.hum_modulation[i + 1] * std::sin(angle);
    }
    out += law.hum_amplitude * share *
           sin(law.hum_frequency_hz * (2.0 * pi * time_s) + law.hum_phase_rad);
  }
  if (value_of(law.limit) > 0.0) {
    if (out > law.limit) out = law.limit;
    if (out < -law.limit) out = -law.limit;
  }
  return out;
}

namespace {

// Below this slope of a characteristic the second order is as large as the first.
constexpr double min_slope = 0.25;

// The argument at which the law's characteristic is `reading`, by Newton's method, and its slope
// there.
std::optional<CorrectedReading> before_characteristic(const ReadingLaw<double>& law,
                                                      double reading) {
  std::array<Dual, max_characteristic_parameters> parameters;
  std::copy(law.characteristic_parameters.begin(), law.characteristic_parameters.end(),
            parameters.begin());
  CorrectedReading out{reading, 1.0};
  for (int iteration = 0; iteration < 50; ++iteration) {
    Dual distorted(out.value);
    distorted.d[0] = 1.0F;
    law.characteristic->distort(distorted, parameters.data());
    out.slope = static_cast<double>(distorted.d[0]);
    if (!(out.slope > min_slope)) return std::nullopt;
    const double step = (reading - distorted.a) / out.slope;
    out.value += step;
    if (std::abs(step) <= 1.0e-12 * std::abs(out.value)) return out;
  }
  return std::nullopt;
}

}  // namespace

std::optional<CorrectedReading> correct_reading(const ReadingLaw<double>& law, double reading) {
  double distorted = reading - law.offset;
  double slope = 1.0;
  if (law.characteristic != nullptr) {
    const auto before = before_characteristic(law, distorted);
    if (!before) return std::nullopt;
    distorted = before->value;
    slope = before->slope;
  }
  // The solution of distorted = linear (1 + curvature linear) near 0; the slope there is the root.
  const double square = 1.0 + 4.0 * law.curvature * distorted;
  if (!(square > min_slope * min_slope)) return std::nullopt;
  const double root = std::sqrt(square);
  return CorrectedReading{2.0 * distorted / ((1.0 + root) * law.gain),
                          1.0 / (root * law.gain * slope)};
}

template double reading_of(const ReadingLaw<double>&, const double&, double);
template Dual reading_of(const ReadingLaw<Dual>&, const Dual&, double);

template <class T>
SensorErrors<T>::SensorErrors(const ReadingLaws<T>& laws, const SensorBank& bank, double step_s)
    : laws_(laws), bank_(&bank), step_s_(step_s) {
  rolls_off_ = value_of(laws.velocity_cutoff_hz) > 0.0;
  if (rolls_off_) {
    // Exact for inputs that are linear over the step.
    using std::exp;
    const T angle = laws.velocity_cutoff_hz * (2.0 * pi * step_s);
    stay_ = exp(-angle);
    const T mean = (1.0 - stay_) / angle;
    before_ = mean - stay_;
    after_ = 1.0 - mean;
  }
}

template <class T>
void SensorErrors<T>::settle(SensorErrorState<T>& memory, const SensorMemory<T>& chains) const {
  memory.into_differentiator = bank_->velocity_before_roll_off(chains);
  memory.rolled_off = memory.into_differentiator;
  if (laws_.any_delay) memory.past.settle(rolled_off_readings(memory, chains), step_s_);
}

template <class T>
void SensorErrors<T>::advance(SensorErrorState<T>& memory, const SensorMemory<T>& chains) const {
  if (rolls_off_) {
    const T input = bank_->velocity_before_roll_off(chains);
    memory.rolled_off =
        stay_ * memory.rolled_off + before_ * memory.into_differentiator + after_ * input;
    memory.into_differentiator = input;
  }
  if (laws_.any_delay) memory.past.push(rolled_off_readings(memory, chains));
}

template <class T>
Readings<T> SensorErrors<T>::rolled_off_readings(const SensorErrorState<T>& memory,
                                                 const SensorMemory<T>& chains) const {
  Readings<T> readings = bank_->readings(chains);
  if (rolls_off_) readings.velocity = memory.rolled_off;
  return readings;
}

template <class T>
Readings<T> SensorErrors<T>::readings(const SensorErrorState<T>& memory,
                                      const SensorMemory<T>& chains, double time_s) const {
  Readings<T> delayed = rolled_off_readings(memory, chains);
  if (laws_.any_delay) {
    for (const Channel channel : read_channels) {
      const T& delay = laws_.of[index_of(channel)].delay_s;
      if (value_of(delay) == 0.0) continue;
      channel_of(delayed, channel) = memory.past.delayed(
          delay,
          [channel](const Readings<T>& past) -> const T& { return channel_of(past, channel); });
    }
  }
  Readings<T> out;
  for (const Channel channel : read_channels) {
    const ReadingLaw<T>& law = laws_.of[index_of(channel)];
    T value = channel_of(delayed, channel);
    if (law.crosstalk_from) value += law.crosstalk * channel_of(delayed, *law.crosstalk_from);
    channel_of(out, channel) = reading_of(law, value, time_s);
  }
  return out;
}

template class SensorErrors<double>;
template class SensorErrors<Dual>;

}  // namespace stickslip::physics
