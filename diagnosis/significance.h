// SPDX-License-Identifier: Apache-2.0
// Significance of a deviation by the normal distribution and by Student's t.
#pragma once

#include <cmath>
#include <numbers>

namespace stickslip::diagnosis {

/// Probability that a standard normal variable exceeds `z`.
inline double normal_chance(double z) { return 0.5 * std::erfc(z / std::numbers::sqrt2); }

/// The inverse of normal_chance for a small probability (Abramowitz and Stegun, 26.2.23).
inline double normal_deviate(double probability) {
  const double t = std::sqrt(-2.0 * std::log(probability));
  return t - (2.515517 + t * (0.802853 + t * 0.010328)) /
                 (1.0 + t * (1.432788 + t * (0.189269 + t * 0.001308)));
}

/// The standard normal variable that is exceeded as often as `t` by Student's with `degrees` > 0 of
/// freedom (Wallace 1959).
inline double deviate_of_student(double t, double degrees) {
  const double z = (8.0 * degrees + 1.0) / (8.0 * degrees + 3.0) *
                   std::sqrt(degrees * std::log1p(t * t / degrees));
  return std::copysign(z, t);
}

}  // namespace stickslip::diagnosis
