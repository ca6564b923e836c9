// SPDX-License-Identifier: Apache-2.0
// The noise beneath the lines of a spectrum, of any colour.
#pragma once

#include <cmath>
#include <span>
#include <vector>

namespace stickslip::diagnosis {

/// Power of the noise of a channel by frequency, as the variance of the white noise that has as
/// much there: at least that of white noise of `noise_std`, and the continuum of the samples where
/// their signal is one of lines. A continuum with a noticeable share of all power is a signal
/// itself, such as a sweep: the noise is white then.
class NoiseFloor {
 public:
  /// White noise.
  explicit NoiseFloor(double noise_std) : white_(noise_std * noise_std) {}
  NoiseFloor(std::span<const double> samples, double period_s, double noise_std);

  /// [units of the samples, squared]
  double at(double frequency_hz) const;

  /// Standard deviation of the white noise [units of the samples].
  double white_std() const { return std::sqrt(white_); }

 private:
  double white_ = 0.0;
  double knots_per_hz_ = 0.0;
  std::vector<double> power_;  // at knots
};

}  // namespace stickslip::diagnosis
