// SPDX-License-Identifier: Apache-2.0
// Consistency of the filter, as two running statistics: mean NIS per degree of freedom, 1 for a
// consistent filter, and the lag-one correlation of each channel's innovations, 0 for a consistent
// filter (Bar-Shalom, Li, Kirubarajan: Estimation with Applications to Tracking and Navigation,
// section 5.4, with exponential forgetting instead of a window).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "physics/frame.h"

namespace stickslip::observer {

/// Mean with exponential forgetting, and the variance of that mean for independent observations.
class RunningMean {
 public:
  /// `weight`: of a new observation in the long run, 0 to 1; `variance`: of the observation.
  void add(double observation, double variance, double weight) {
    count_ += 1.0;
    const double w = std::max(weight, 1.0 / count_);
    mean_ += w * (observation - mean_);
    variance_ += w * (w * variance - (2.0 - w) * variance_);
  }

  double mean() const { return mean_; }
  /// Half width of the 95 % interval of the mean; 0 before the first observation.
  double bound() const { return 1.96 * std::sqrt(variance_); }

 private:
  double count_ = 0.0;
  double mean_ = 0.0;
  double variance_ = 0.0;
};

class Consistency {
 public:
  /// `period_s`: sampling period, > 0.
  explicit Consistency(double period_s) : weight_(std::min(1.0, period_s / memory_s)) {}

  /// A channel's innovation over its expected standard deviation; at most once per frame.
  void add_innovation(std::size_t channel, double normalised) {
    if (has_last_[channel]) whiteness_[channel].add(normalised * last_[channel], 1.0, weight_);
    last_[channel] = normalised;
    has_last_[channel] = true;
  }

  /// NIS of a frame and its degrees of freedom; ignored where these are 0.
  void add_nis(double nis, int freedom) {
    if (freedom > 0) nis_.add(nis / freedom, 2.0 / freedom, weight_);
  }

  /// After a reinitialisation of the filter the next innovations have no predecessor.
  void reinitialise() { has_last_.fill(false); }

  const RunningMean& nis() const { return nis_; }
  const RunningMean& whiteness(std::size_t channel) const { return whiteness_[channel]; }

  static constexpr double memory_s = 2.0;

 private:
  double weight_;
  RunningMean nis_;
  std::array<RunningMean, channel_count> whiteness_;
  std::array<double, channel_count> last_{};
  std::array<bool, channel_count> has_last_{};
};

}  // namespace stickslip::observer
