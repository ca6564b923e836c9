// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/instruments.h"

#include <numbers>

namespace stickslip::diagnosis {

namespace {

constexpr double gain_sigma = 0.005;
constexpr double offset_share = 0.01;  // of the channel's standard deviation
constexpr double delay_samples = 0.3;  // of a multiplexed converter
constexpr double cutoff_share = 0.02;

// Delays count from the channel of the drive: a delay of all channels is none, and would be a
// direction in which nothing holds a fit.
double delay_sigma_s(const Experiment& e) {
  return std::numbers::sqrt2 * delay_samples * e.period_s;
}

bool is_recorded(const Experiment& e, Channel channel) {
  return e.noise_std[index_of(channel)] > 0.0;
}

// Channels whose readings are compared or act: of an imposed motion only times matter, and the
// friction force has those.
bool matters(const physics::Model& model, const Experiment& e, Channel channel) {
  if (index_of(channel) < predicted_channels && e.is_compared(index_of(channel))) return true;
  if (!is_recorded(e, channel)) return false;
  switch (model.oscillator.excitation) {
    case physics::Excitation::base:
      return channel == Channel::base_displacement;
    case physics::Excitation::force:
      return channel == Channel::drive_force;
    case physics::Excitation::imposed:
      return false;
  }
  return false;
}

}  // namespace

physics::Model with_instruments(physics::Model model, const Experiment& e) {
  const Channel drive = drive_channel(model.oscillator.excitation);
  for (const Channel channel : all_channels) {
    const bool is_compared_or_acts = matters(model, e, channel);
    if (!is_compared_or_acts && channel != drive) continue;
    physics::Sensor& sensor = model.sensors[index_of(channel)];
    for (physics::Filter& filter : sensor.filters) {
      physics::Parameter& cutoff_hz = filter.cutoff_hz;
      if (!(cutoff_hz.sigma > 0.0)) cutoff_hz.sigma = cutoff_share * cutoff_hz.value;
    }
    if (!is_compared_or_acts) continue;
    if (!sensor.gain) sensor.gain = {1.0, gain_sigma};
    // The zero of a base does not move its acceleration.
    if (!sensor.offset && channel != Channel::base_displacement) {
      sensor.offset = {0.0, offset_share * e.channel_std[index_of(channel)]};
    }
    if (!sensor.delay_s && index_of(channel) < predicted_channels) {
      sensor.delay_s = {0.0, delay_sigma_s(e)};
    }
  }
  return model;
}

}  // namespace stickslip::diagnosis
