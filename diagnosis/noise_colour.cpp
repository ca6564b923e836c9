// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/noise_colour.h"

#include <cmath>

namespace stickslip::diagnosis {

Whitening::Step Whitening::next(double time_s) {
  if (colour_.is_white()) return {};
  Step step;
  if (begun_) {
    const double interval_s = time_s - time_s_;
    if (interval_s != interval_s_) keep_ = std::exp(-interval_s / colour_.correlation_s);
    interval_s_ = interval_s;
    step.keep = keep_;
    variance_ = keep_ * keep_ * variance_ + colour_.share * (1.0 - keep_ * keep_);
  }
  begun_ = true;
  time_s_ = time_s;
  const double innovation = variance_ + (1.0 - colour_.share);
  step.gain = variance_ / innovation;
  step.scale = 1.0 / std::sqrt(innovation);
  variance_ *= 1.0 - step.gain;
  return step;
}

}  // namespace stickslip::diagnosis
