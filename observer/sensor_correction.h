// SPDX-License-Identifier: Apache-2.0
// Correction of the sensor errors that a model's [[physics]] terms describe, before a reading
// enters the filter: gain and curvature are inverted, a saturated reading is dropped. Delays, hum
// and drift have states instead (sensor_error_states.h), crosstalk is part of the measurement row
// (layout.h).
#pragma once

#include <array>
#include <string>
#include <vector>

#include "physics/effect.h"
#include "physics/frame.h"
#include "physics/model.h"

namespace stickslip::observer {

/// A model without its terms that only concern sensors, and the reading laws of those terms.
struct SeparatedModel {
  physics::Model model;
  physics::ReadingLaws<double> laws;
  /// The laws with one parameter higher by its standard deviation, for each that has one.
  std::vector<physics::ReadingLaws<double>> shifted;
  std::vector<std::string> shifted_paths;  ///< those parameters
};

/// A different cutoff of the velocity's differentiator becomes part of the model's sensor chain.
/// Throws std::invalid_argument where inconsistencies_of(declared) is not empty.
SeparatedModel separate_sensor_errors(const physics::Model& declared);

class SensorCorrection {
 public:
  explicit SensorCorrection(const physics::ReadingLaws<double>& laws);

  bool any() const { return laws_.any_error; }

  using PerChannel = std::array<double, channel_count>;

  /// Invalidates readings at a limit: they are only a bound of the true value. `variance`: of the
  /// readings.
  void drop_saturated(Frame& frame, const PerChannel& variance) const;

  /// Inverts gain and curvature of the readings of a frame; readings that cannot be corrected
  /// become invalid. `variance` becomes that of the corrected readings.
  void correct(Frame& frame, PerChannel& variance);

  /// Magnitude of d corrected / d reading, from the last frame that had the channel.
  double slope(Channel channel) const { return slope_[index_of(channel)]; }

 private:
  physics::ReadingLaws<double> laws_;
  PerChannel slope_;
};

}  // namespace stickslip::observer
