#include "physics/reading.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace stickslip::physics {

namespace {

using std::numbers::pi;

template <class AnyReadings>
auto& of(AnyReadings& readings, Channel channel) {
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

// How long the drift has gone on, as if at its first rate.
template <class T>
T drifted_s(const ReadingLaw<T>& law, double time_s) {
  using std::exp;
  if (time_s < 1.0e-8 * value_of(law.drift_settles_s)) return T(time_s);
  return law.drift_settles_s * (1.0 - exp(-time_s / law.drift_settles_s));
}

}  // namespace

template <class T>
T misread(const ReadingLaw<T>& law, const T& value, double time_s) {
  using std::sin;
  T out = law.gain * value;
  out += law.curvature * out * out;
  out += law.drift_per_s * drifted_s(law, time_s);
  if (value_of(law.hum_frequency_hz) > 0.0) {
    T share(1.0);
    for (std::size_t i = 0; i < law.hum_wander.size(); i += 2) {
      const double angle = pi * static_cast<double>(i + 2) * time_s / law.hum_wander_over_s;
      share += law.hum_wander[i] * std::cos(angle) + law.hum_wander[i + 1] * std::sin(angle);
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

std::optional<RightedReading> put_right(const ReadingLaw<double>& law, double reading) {
  // The branch of reading = straight (1 + curvature straight) that goes through 0. Its slope is the
  // root; of a reading where that is small the second order counts as much as the first.
  constexpr double least_root = 0.25;
  const double square = 1.0 + 4.0 * law.curvature * reading;
  if (!(square > least_root * least_root)) return std::nullopt;
  const double root = std::sqrt(square);
  return RightedReading{2.0 * reading / ((1.0 + root) * law.gain), 1.0 / (root * law.gain)};
}

template double misread(const ReadingLaw<double>&, const double&, double);
template Dual misread(const ReadingLaw<Dual>&, const Dual&, double);

template <class T>
ReadingFaults<T>::ReadingFaults(const ReadingLaws<T>& laws, const SensorBank& bank, double step_s)
    : laws_(laws), bank_(&bank), step_s_(step_s) {
  rolls_off_ = value_of(laws.velocity_cutoff_hz) > 0.0;
  if (rolls_off_) {
    // Exact for an input that is a straight line over the step.
    using std::exp;
    const T turn = laws.velocity_cutoff_hz * (2.0 * pi * step_s);
    stay_ = exp(-turn);
    const T mean = (1.0 - stay_) / turn;
    before_ = mean - stay_;
    after_ = 1.0 - mean;
  }
}

template <class T>
void ReadingFaults<T>::settle(FaultMemory<T>& memory, const SensorMemory<T>& chains) const {
  memory.into_differentiator = bank_->velocity_before_roll_off(chains);
  memory.rolled_off = memory.into_differentiator;
  if (laws_.late) memory.past.settle(undisturbed(memory, chains), step_s_);
}

template <class T>
void ReadingFaults<T>::advance(FaultMemory<T>& memory, const SensorMemory<T>& chains) const {
  if (rolls_off_) {
    const T input = bank_->velocity_before_roll_off(chains);
    memory.rolled_off =
        stay_ * memory.rolled_off + before_ * memory.into_differentiator + after_ * input;
    memory.into_differentiator = input;
  }
  if (laws_.late) memory.past.push(undisturbed(memory, chains));
}

template <class T>
Readings<T> ReadingFaults<T>::undisturbed(const FaultMemory<T>& memory,
                                          const SensorMemory<T>& chains) const {
  Readings<T> readings = bank_->readings(chains);
  if (rolls_off_) readings.velocity = memory.rolled_off;
  return readings;
}

template <class T>
Readings<T> ReadingFaults<T>::readings(const FaultMemory<T>& memory, const SensorMemory<T>& chains,
                                       double time_s) const {
  Readings<T> late = undisturbed(memory, chains);
  if (laws_.late) {
    for (const Channel channel : read_channels) {
      const T& delay = laws_.of[index_of(channel)].delay_s;
      if (value_of(delay) == 0.0) continue;
      of(late, channel) = memory.past.ago(
          delay, [channel](const Readings<T>& past) -> const T& { return of(past, channel); });
    }
  }
  Readings<T> out;
  for (const Channel channel : read_channels) {
    const ReadingLaw<T>& law = laws_.of[index_of(channel)];
    T value = of(late, channel);
    if (law.leak_from) value += law.leak * of(late, *law.leak_from);
    of(out, channel) = misread(law, value, time_s);
  }
  return out;
}

template class ReadingFaults<double>;
template class ReadingFaults<Dual>;

}  // namespace stickslip::physics
