// Whether the filter is right about its own doubt, as two running numbers: the mean of NIS per
// degree of freedom, 1 where it is, and the correlation of each channel's innovations from frame to
// frame, 0 where it is (Bar-Shalom, Li, Kirubarajan: Estimation with Applications to Tracking and
// Navigation, section 5.4, with a forgetting mean instead of a window).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "physics/frame.h"

namespace stickslip::observer {

/// A mean over the latest observations that forgets exponentially, and the variance of that mean
/// where observations are independent.
class RunningMean {
 public:
  /// `weight`: of a new observation, 0 to 1, once there are enough; `variance`: of the observation.
  void take(double observation, double variance, double weight) {
    count_ += 1.0;
    const double w = std::max(weight, 1.0 / count_);
    mean_ += w * (observation - mean_);
    variance_ += w * (w * variance - (2.0 - w) * variance_);
  }

  double mean() const { return mean_; }
  /// Half the width of the interval that holds 95 % of such means; 0 before the first observation.
  double bound() const { return 1.96 * std::sqrt(variance_); }

 private:
  double count_ = 0.0;
  double mean_ = 0.0;
  double variance_ = 0.0;
};

class Consistency {
 public:
  /// `period_s`: of the frames, > 0.
  explicit Consistency(double period_s) : weight_(std::min(1.0, period_s / memory_s)) {}

  /// A channel's innovation over its expected standard deviation. Once per frame at most.
  void take(std::size_t channel, double normalised) {
    if (follows_[channel]) whiteness_[channel].take(normalised * last_[channel], 1.0, weight_);
    last_[channel] = normalised;
    follows_[channel] = true;
  }

  /// A frame's NIS with that many degrees of freedom; 0 counts nothing.
  void take_frame(double nis, int freedom) {
    if (freedom > 0) nis_.take(nis / freedom, 2.0 / freedom, weight_);
  }

  /// The filter began anew: its next innovation follows none.
  void begin_anew() { follows_.fill(false); }

  const RunningMean& nis() const { return nis_; }
  const RunningMean& whiteness(std::size_t channel) const { return whiteness_[channel]; }

  static constexpr double memory_s = 2.0;

 private:
  double weight_;
  RunningMean nis_;
  std::array<RunningMean, channel_count> whiteness_;
  std::array<double, channel_count> last_{};
  std::array<bool, channel_count> follows_{};
};

}  // namespace stickslip::observer
