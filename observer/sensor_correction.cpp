#include "observer/sensor_correction.h"

#include <algorithm>
#include <cmath>
#include <span>
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
  return physics::find_effect(term.id)->hooks() == physics::hook::reading;
}

}  // namespace

SeparatedModel separate_sensor_errors(const physics::Model& declared) {
  const physics::Rig rig(declared);
  SeparatedModel out{declared, rig.numbers<double>(std::span(rig.parameter_values())).reading};
  std::erase_if(out.model.terms, concerns_sensors_only);
  if (out.laws.velocity_cutoff_hz > 0.0) {
    std::vector<physics::Filter>& filters = out.model.sensors[index_of(Channel::velocity)].filters;
    const bool declares_one =
        !filters.empty() && (filters.back().kind == physics::FilterKind::first_order_lowpass ||
                             filters.back().order == 1);
    if (declares_one) filters.pop_back();
    filters.push_back({physics::FilterKind::first_order_lowpass, 1, out.laws.velocity_cutoff_hz});
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
