// SPDX-License-Identifier: Apache-2.0
#include "observer/sensor_correction.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "physics/catalogue.h"
#include "physics/reading.h"
#include "physics/rig.h"

namespace stickslip::observer {

namespace {

// Distance from a limit within which a reading may be saturated: in standard deviations of its
// noise, and as a share of the limit, which has an uncertainty of its own.
constexpr double margin_sigmas = 3.0;
constexpr double margin_share = 0.002;

bool concerns_sensors_only(const physics::Term& term) {
  return physics::effect_of(term)->hooks() == physics::hook::reading;
}

bool is_of_a_sensor(const std::string& path, const physics::Model& model) {
  if (path.starts_with("sensors.")) return true;
  return std::any_of(model.terms.begin(), model.terms.end(), [&](const physics::Term& term) {
    return path.starts_with(physics::path_of(term) + '.') && concerns_sensors_only(term);
  });
}

// Sizes of random errors, and limits within which a reading is not trusted: wider by what is
// uncertain about them.
void widen(physics::ReadingLaws<double>& laws, const physics::ReadingLaws<double>& shifted,
           const physics::ReadingLaws<double>& declared) {
  for (std::size_t i = 0; i < channel_count; ++i) {
    const auto& from = declared.of[i];
    const auto& to = shifted.of[i];
    auto& wide = laws.of[i];
    wide.hum_amplitude = std::hypot(wide.hum_amplitude, to.hum_amplitude - from.hum_amplitude);
    wide.drift_per_s = std::hypot(wide.drift_per_s, to.drift_per_s - from.drift_per_s);
    wide.limit -= 2.0 * (to.limit - from.limit);
  }
}

void add_shifted_laws(const physics::Rig& rig, const physics::Model& declared,
                      SeparatedModel& out) {
  physics::Model copy = declared;
  const std::vector<physics::NamedParameter> parameters = physics::parameters_of(copy);
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const double sigma = parameters[i].parameter->sigma;
    if (!(sigma > 0.0) || !is_of_a_sensor(parameters[i].path, declared)) continue;
    std::vector<double> values = rig.parameter_values();
    values[i] += sigma;
    out.shifted.push_back(rig.numbers<double>(std::span<const double>(values)).reading);
    out.shifted_paths.push_back(parameters[i].path);
  }
}

}  // namespace

SeparatedModel separate_sensor_errors(const physics::Model& declared) {
  const physics::Rig rig(declared);
  SeparatedModel out{
      declared, rig.numbers<double>(std::span(rig.parameter_values())).reading, {}, {}};
  add_shifted_laws(rig, declared, out);
  const physics::ReadingLaws<double> laws = out.laws;
  for (const auto& shifted : out.shifted) widen(out.laws, shifted, laws);
  std::erase_if(out.model.terms, concerns_sensors_only);
  for (physics::Sensor& sensor : out.model.sensors) {
    sensor.gain.reset();
    sensor.offset.reset();
    sensor.delay_s.reset();
    for (physics::Filter& filter : sensor.filters) filter.cutoff_hz.sigma = 0.0;
  }
  if (out.laws.velocity_cutoff_hz > 0.0) {
    std::vector<physics::Filter>& filters = out.model.sensors[index_of(Channel::velocity)].filters;
    const bool declares_one =
        !filters.empty() && (filters.back().kind == physics::FilterKind::first_order_lowpass ||
                             filters.back().order == 1);
    if (declares_one) filters.pop_back();
    filters.push_back({physics::FilterKind::first_order_lowpass, 1, {out.laws.velocity_cutoff_hz}});
  }
  return out;
}

SensorCorrection::SensorCorrection(const physics::ReadingLaws<double>& laws) : laws_(laws) {
  slope_.fill(1.0);
}

void SensorCorrection::drop_saturated(Frame& frame, const PerChannel& variance) const {
  for (Channel channel : all_channels) {
    const std::size_t i = index_of(channel);
    const double limit = laws_.of[i].limit;
    if (!(limit > 0.0) || !frame.has(channel)) continue;
    const double margin = std::max(margin_sigmas * std::sqrt(variance[i]), margin_share * limit);
    if (std::abs(frame[channel]) > limit - margin) frame.invalidate(channel);
  }
}

void SensorCorrection::correct(Frame& frame, PerChannel& variance) {
  for (Channel channel : all_channels) {
    if (!frame.has(channel)) continue;
    const std::size_t i = index_of(channel);
    const auto corrected = physics::correct_reading(laws_.of[i], frame[channel]);
    if (!corrected) {
      frame.invalidate(channel);
      continue;
    }
    frame.set(channel, corrected->value);
    variance[i] *= corrected->slope * corrected->slope;
    slope_[i] = std::abs(corrected->slope);
  }
}

}  // namespace stickslip::observer
