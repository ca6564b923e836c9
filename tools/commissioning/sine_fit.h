// SPDX-License-Identifier: Apache-2.0
// Amplitude and phase of readings at a known frequency.
#pragma once

#include <span>

namespace stickslip::commissioning {

/// mean + amplitude sin(2 pi f t + phase).
struct Sine {
  double mean = 0.0;
  double amplitude = 0.0;
  double phase = 0.0;            ///< [rad], -pi to pi
  double amplitude_sigma = 0.0;  ///< standard uncertainty, of independent residuals
};

/// By least squares. Times [s] and values of the same length, 4 or more, over a period or more.
Sine sine_of(std::span<const double> time_s, std::span<const double> value, double frequency_hz);

}  // namespace stickslip::commissioning
