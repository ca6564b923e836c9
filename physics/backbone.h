// SPDX-License-Identifier: Apache-2.0
// One implicit step of a friction law that follows tanh(w / speed): the slip velocity at which
// contact and inertia balance.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

namespace stickslip::physics {

/// Diagonal coefficient of the implicit part of ARS(2,2,2), for which it is L-stable.
inline constexpr double gamma_ars = 1.0 - 1.0 / std::numbers::sqrt2;

// The solution w of w + a (p + q tanh(w / speed)) = target, and tanh(w / speed).
struct BackboneSlip {
  double w = 0.0;
  double tanh = 0.0;
};

// Absolute error about 1e-16, at less than half the time of std::tanh, whose relative error is
// small near 0.
inline double quick_tanh(double x) {
  return 1.0 - 2.0 / (std::exp(std::clamp(2.0 * x, -80.0, 80.0)) + 1.0);
}

// a and q >= 0, so the equation is monotone in w, and Halley's method inside a shrinking bracket
// converges. It is of third order: after a step of 1e-5 the error is below double precision, and
// the tanh, the costly part, need not be evaluated again.
inline BackboneSlip solve_backbone(double target, double a, double p, double q, double speed,
                                   double guess) {
  double low = target - a * (p + q);
  double high = target - a * (p - q);
  // Beyond this tanh is 1 in double precision, and the slip is an end of the bracket.
  constexpr double saturated = 17.0;
  if (low > saturated * speed) return {low, 1.0};
  if (high < -saturated * speed) return {high, -1.0};
  // In saturation the solution is near an end of the bracket, elsewhere near the last one.
  double w = low > 3.0 * speed ? low : (high < -3.0 * speed ? high : std::clamp(guess, low, high));
  double t = 0.0;
  for (int iteration = 0; iteration < 60; ++iteration) {
    t = quick_tanh(w / speed);
    const double residual = w + a * (p + q * t) - target;
    if (residual > 0.0) {
      high = w;
    } else {
      low = w;
    }
    const double bend = a * q * (1.0 - t * t) / speed;
    const double slope = 1.0 + bend;
    const double curvature = -2.0 * bend * t / speed;
    const double halley = slope * slope - 0.5 * residual * curvature;
    const double step = halley > 0.0 ? residual * slope / halley : residual / slope;
    double next = w - step;
    // Tested before the bracket is: at the root `next` is one of its ends.
    if (std::abs(step) <= 1.0e-5 * speed) {
      const double d = -step / speed;
      return {next, t + (1.0 - t * t) * d * (1.0 - t * d)};
    }
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    w = next;
  }
  return {w, t};
}

}  // namespace stickslip::physics
