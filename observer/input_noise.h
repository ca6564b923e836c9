// SPDX-License-Identifier: Apache-2.0
// Process noise of a measured input, the drive or the normal load: a derivative of it is white
// noise, whose density follows from how well the input's own readings are predicted.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace stickslip::observer {

class InputNoise {
 public:
  /// `derivative`: the one that is white noise, at least 1. A Kalman filter with noise of density q
  /// there and readings of density r has a bandwidth of (q / r)^(1 / (2 derivative)) rad/s. It
  /// begins with 20 Hz and stays within 0.3 and 60 Hz.
  InputNoise(int derivative, double period_s)
      : order_(2 * derivative),
        period_s_(period_s),
        log_density_(log_density(20.0)),
        least_(log_density(0.3)),
        most_(log_density(60.0)) {}

  /// Density of the noise times a period, in units of the variance of the readings.
  double per_period() const { return std::exp(log_density_) * period_s_; }

  /// Innovations of a consistent filter are white and of unit size: larger ones, or positive
  /// correlation, mean too little process noise, smaller ones or negative correlation too much.
  /// `source`: 0 or 1, for an input with two channels.
  void adapt(double normalised_innovation, std::size_t source = 0) {
    if (!std::isfinite(normalised_innovation)) return;  // the filter has diverged, not the input
    const double squared = normalised_innovation * normalised_innovation;
    const double size = std::min(squared - 1.0, 20.0);
    double& past = trend_[source];
    const double trend = std::clamp(normalised_innovation * past, -20.0, 20.0);
    past += -past * std::min(1.0, period_s_ / trend_memory_s) +
            std::clamp(normalised_innovation, -5.0, 5.0);
    const double step = (size + trend) * period_s_ / adaptation_s;
    log_density_ = std::clamp(log_density_ + step, least_, most_);
  }

 private:
  static constexpr double adaptation_s = 1.0;
  static constexpr double trend_memory_s = 0.01;

  double log_density(double bandwidth_hz) const {
    return order_ * std::log(2.0 * std::numbers::pi * bandwidth_hz);
  }

  int order_;
  double period_s_;
  double log_density_, least_, most_;
  std::array<double, 2> trend_{};  ///< sum of the past innovations of each source
};

}  // namespace stickslip::observer
