// The slip velocity at which a contact and what it holds back agree: one implicit step of friction
// that follows tanh(w / speed).
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

namespace stickslip::physics {

/// The share of a step that the contact acts in each stage of ARS(2,2,2): L-stable.
inline constexpr double gamma_ars = 1.0 - 1.0 / std::numbers::sqrt2;

// w and tanh(w / speed), for w + a (p + q tanh(w / speed)) = target.
struct BackboneSlip {
  double w = 0.0;
  double tanh = 0.0;
};

// To about 1e-16, at less than half the price of the library's, which is good to all digits near 0.
inline double quick_tanh(double x) {
  return 1.0 - 2.0 / (std::exp(std::clamp(2.0 * x, -80.0, 80.0)) + 1.0);
}

// a and q >= 0, so the equation is monotone in w, and Halley's steps inside a shrinking bracket
// always arrive. Their error cubes: after one of 1e-5 it is at the end of a double, and the tanh,
// which is what costs here, need not be taken again.
inline BackboneSlip solve_backbone(double target, double a, double p, double q, double speed,
                                   double guess) {
  double low = target - a * (p + q);
  double high = target - a * (p - q);
  // Beyond this the tanh is 1 to the last digits of a double, and the slip is one of the ends.
  constexpr double saturated = 17.0;
  if (low > saturated * speed) return {low, 1.0};
  if (high < -saturated * speed) return {high, -1.0};
  // Where the law has saturated the slip is one of the ends; elsewhere where it was last is nearer.
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
    // Before the bracket: at the root itself `next` is one of its ends.
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
