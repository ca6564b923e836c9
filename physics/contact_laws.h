// SPDX-License-Identifier: Apache-2.0
// One implicit stage of a contact whose law is given by name: a loop of Bouc and Wen, parallel
// elements that stick until they slip, and friction that depends on the contact's age. Each has
// one solution w, since its force grows with w at any state.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "physics/effect.h"

namespace stickslip::physics {

// The contact problem of one implicit stage: the slip velocity w with
// w + alpha mobility f(w) = free_slip.
template <class T>
struct Stage {
  double alpha = 0.0;  // length of the stage [s]
  double guess = 0.0;  // of w
  T free_slip{0.0};    // w without friction
  T mobility{0.0};     // slip velocity per unit of impulse
  T level{0.0};        // mu N, or mu in newtons
  T backbone{1.0};     // factor on the backbone
};

template <class T>
struct ContactSolution {
  T slip{0.0};
  T force{0.0};
  T theta{0.0};
  T contact{0.0};  // the contact's state: theta, its fast part, or the bristle's deflection
  T slow{0.0};     // with two processes: the slow part of theta
};

// ---- A loop of Bouc and Wen
// ----------------------------------------------------------------------

// z' = w (1 - (z r)^n) while loading, w (1 + loop abs(z r)^n) while unloading, with 1/r the
// deflection at which it slips: the root z of one backward step, where w = target - a z > 0.
struct LoopStage {
  double target = 0.0;
  double a = 0.0;
  double z0 = 0.0;
  double alpha = 0.0;
  double r = 0.0;
  double loop = 0.0;
  double n = 1.0;

  double yield(double z) const {
    const double share = std::pow(std::abs(z) * r, n);
    return z < 0.0 ? -loop * share : share;
  }
  double residual(double z) const { return z - z0 - alpha * (target - a * z) * (1.0 - yield(z)); }
  double slope(double z) const {
    const double ratio = std::max(std::abs(z) * r, 1.0e-12);
    const double by_z = n * r * std::pow(ratio, n - 1.0) * (z < 0.0 ? loop : 1.0);
    return 1.0 + alpha * a * (1.0 - yield(z)) + alpha * (target - a * z) * by_z;
  }
};

inline double solve_loop(const LoopStage& stage) {
  const double most = std::max(std::abs(stage.z0), 1.0 / stage.r);
  double low = -most;
  double high = most;
  double z = stage.z0;
  double before = 2.0 * std::abs(stage.residual(z));
  for (int iteration = 0; iteration < 100; ++iteration) {
    const double residual = stage.residual(z);
    (residual > 0.0 ? high : low) = z;
    double next = z - residual / stage.slope(z);
    if (std::abs(next - z) <= 1.0e-14 * most) return std::clamp(next, low, high);
    // Where the power has no derivative Newton's steps are too short.
    if (!(next > low && next < high) || std::abs(residual) > 0.5 * before) {
      next = 0.5 * (low + high);
    }
    before = std::abs(residual);
    z = next;
  }
  return z;
}

template <class T>
void solve_loop_contact(const Stage<T>& stage, const Coefficients<T>& c, const T& z0,
                        ContactSolution<T>& out) {
  using std::abs;
  using std::pow;
  const T level =
      value_of(stage.level * stage.backbone) > 1.0e-12 ? stage.level * stage.backbone : T(1.0e-12);
  const T r = c.contact_stiffness / level;
  const T a = stage.mobility * stage.alpha * c.contact_stiffness;
  const double towards = value_of(stage.free_slip) - value_of(a) * value_of(z0);
  const double sign = towards < 0.0 ? -1.0 : 1.0;
  const LoopStage one{sign * value_of(stage.free_slip),
                      value_of(a),
                      sign * value_of(z0),
                      stage.alpha,
                      value_of(r),
                      value_of(c.loop_shape),
                      value_of(c.loop_sharpness)};
  T z = T(sign * (towards == 0.0 ? one.z0 : solve_loop(one)));
  // One Newton step in T leaves the value unchanged and makes the derivatives exact.
  const bool loading = value_of(z) * sign >= 0.0;
  const T share = pow(abs(z) * r + 1.0e-12, c.loop_sharpness);
  const T yields = loading ? share : -(c.loop_shape * share);
  const T residual = z - z0 - stage.alpha * (stage.free_slip - a * z) * (1.0 - yields);
  z -= residual * (1.0 / one.slope(sign * value_of(z)));
  out.slip = stage.free_slip - a * z;
  out.contact = z;
  out.force = c.contact_stiffness * z;
  out.theta = value_of(stage.level) > 1.0e-12 ? out.force / stage.level : T(0.0);
}

// ---- Parallel elements
// -----------------------------------------------------------------------------

inline constexpr int parallel_elements = 4;

// Elements of equal stiffness whose slip forces are spread evenly about their mean.
template <class T>
T element_share(int element, const T& spread) {
  constexpr double n = parallel_elements;
  return (1.0 + spread * ((2.0 * element + 1.0 - n) / n)) * (1.0 / n);
}

// Deflection of an element at the end of a stage with slip velocity w: it sticks up to `most`.
template <class T>
T element_deflection(const T& z0, double alpha, const T& w, const T& most) {
  const T z = z0 + alpha * w;
  if (value_of(z) > value_of(most)) return most;
  if (value_of(z) < -value_of(most)) return -most;
  return z;
}

template <class T>
struct ParallelStage {
  std::array<T, parallel_elements> z0{};
  std::array<T, parallel_elements> most{};  // deflections at which they slip
  T stiffness{0.0};                         // of one element

  // `first`: deflection of the first element, `others`: those of the rest.
  ParallelStage(const Stage<T>& stage, const Coefficients<T>& c, const T& first, const T* others)
      : stiffness(c.contact_stiffness * (1.0 / parallel_elements)) {
    const T level = stage.level * stage.backbone;
    for (int i = 0; i < parallel_elements; ++i) {
      const auto k = static_cast<std::size_t>(i);
      z0[k] = i == 0 ? first : others[i - 1];
      most[k] = level * element_share(i, c.yield_spread) / stiffness;
      if (!(value_of(most[k]) > 0.0)) most[k] = T(0.0);
    }
  }
  T deflection(std::size_t element, double alpha, const T& w) const {
    return element_deflection(z0[element], alpha, w, most[element]);
  }
};

// Sum of the deflections that follow w, and its slope.
template <class T>
double parallel_deflection(const ParallelStage<T>& parallel, double alpha, double w,
                           double& slope) {
  double sum = 0.0;
  slope = 0.0;
  for (std::size_t i = 0; i < parallel.z0.size(); ++i) {
    const double z = value_of(parallel.z0[i]) + alpha * w;
    const double most = value_of(parallel.most[i]);
    sum += std::clamp(z, -most, most);
    if (std::abs(z) < most) slope += alpha;
  }
  return sum;
}

// The force is piecewise linear in w: Newton's steps end on the right piece.
template <class T>
T solve_parallel_slip(const Stage<T>& stage, const ParallelStage<T>& parallel) {
  const T a = stage.mobility * stage.alpha * parallel.stiffness;
  const double target = value_of(stage.free_slip);
  double reach = 0.0;
  for (const T& most : parallel.most) reach += value_of(a) * value_of(most);
  double low = target - reach;
  double high = target + reach;
  double w = std::clamp(stage.guess, low, high);
  double slope = 0.0;
  for (int iteration = 0; iteration < 60; ++iteration) {
    const double residual =
        w + value_of(a) * parallel_deflection(parallel, stage.alpha, w, slope) - target;
    slope = 1.0 + value_of(a) * slope;
    (residual > 0.0 ? high : low) = w;
    double next = w - residual / slope;
    if (std::abs(next - w) <= 1.0e-14 * (std::abs(w) + 1.0e-6)) break;
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    w = next;
  }
  // One Newton step in T leaves the value unchanged and makes the derivatives exact.
  T out(w);
  T sum(0.0);
  for (std::size_t i = 0; i < parallel.z0.size(); ++i) {
    sum += parallel.deflection(i, stage.alpha, out);
  }
  out -= (out + a * sum - stage.free_slip) * (1.0 / slope);
  return out;
}

template <class T>
void solve_parallel_contact(const Stage<T>& stage, const Coefficients<T>& c, const T& first,
                            const T* others, ContactSolution<T>& out) {
  const ParallelStage<T> parallel(stage, c, first, others);
  out.slip = solve_parallel_slip(stage, parallel);
  T sum(0.0);
  for (std::size_t i = 0; i < parallel.z0.size(); ++i) {
    sum += parallel.deflection(i, stage.alpha, out.slip);
  }
  out.contact = parallel.deflection(0, stage.alpha, out.slip);
  out.force = parallel.stiffness * sum;
  out.theta = value_of(stage.level) > 1.0e-12 ? out.force / stage.level : T(0.0);
}

// The deflections of the elements after the first at the end of a solved stage.
template <class T>
void advance_elements(const Stage<T>& stage, const Coefficients<T>& c, const T& slip, T* others) {
  const ParallelStage<T> parallel(stage, c, T(0.0), others);
  for (int i = 1; i < parallel_elements; ++i) {
    others[i - 1] = parallel.deflection(static_cast<std::size_t>(i), stage.alpha, slip);
  }
}

// ---- Friction that depends on the age of the contact
// ------------------------------------------------

// y of y exp(y) = exp(l) (Lambert's function of an exponential).
inline double lambert_of_exp(double l) {
  if (l > 1.0) {
    double y = l - std::log(l);
    for (int i = 0; i < 6; ++i) y -= (y + std::log(y) - l) / (1.0 + 1.0 / y);
    return y;
  }
  const double x = std::exp(l);
  double y = x / (1.0 + x);
  for (int i = 0; i < 6; ++i) y -= (y - x * std::exp(-y)) / (1.0 + x * std::exp(-y));
  return y;
}

// The logarithm p of the age, in units of slip_length / reference_speed, after a stage of `alpha`
// seconds at that speed: one backward step of p' = (v0 exp(-p) - speed) / slip_length.
template <class T>
T aged(const T& from, const T& speed, double alpha, const Coefficients<T>& c) {
  using std::exp;
  const T renewed = from - alpha * speed / c.slip_length;
  const T grown = alpha * c.reference_speed / c.slip_length;
  T p(value_of(renewed) + lambert_of_exp(std::log(value_of(grown)) - value_of(renewed)));
  const T growth = grown * exp(-p);
  p -= (p - renewed - growth) * (1.0 / (1.0 + value_of(growth)));
  return p;
}

// u of v0 (exp(u - l) - exp(-u - l)) + k u = target >= 0: the equation is convex in u, so that
// Newton's method converges from above.
inline double solve_asinh(double target, double v0, double l, double k) {
  if (!(target > 0.0)) return 0.0;
  const double log_x = l + std::log(target / (2.0 * v0));
  double u = log_x > 20.0 ? std::log(2.0) + log_x : std::asinh(std::exp(log_x));
  if (k > 0.0) u = std::min(u, target / k);
  for (int iteration = 0; iteration < 60; ++iteration) {
    const double up = v0 * std::exp(u - l);
    const double down = v0 * std::exp(-u - l);
    const double step = (up - down + k * u - target) / (up + down + k);
    u -= step;
    if (std::abs(step) <= 1.0e-13 * (1.0 + std::abs(u))) break;
  }
  return u;
}

// theta = a asinh(w / (2 v0) exp((1 + b p) / a)), with a and b relative to mu.
template <class T>
void solve_ageing_contact(const Stage<T>& stage, const Coefficients<T>& c, const T& from,
                          ContactSolution<T>& out) {
  using std::abs;
  using std::exp;
  const T k = stage.alpha * stage.mobility * stage.level * stage.backbone * c.direct_share;
  const double sign = value_of(stage.free_slip) < 0.0 ? -1.0 : 1.0;
  out.slip = value_of(stage.mobility) > 0.0 ? T(stage.guess) : stage.free_slip;
  T u(0.0);
  // The age responds little to the slip of one stage: the two are solved in turn.
  for (int round = 0; round < 3; ++round) {
    out.contact = aged(from, T(abs(out.slip)), stage.alpha, c);
    const T l = (1.0 + c.evolution_share * out.contact) / c.direct_share;
    u = T(solve_asinh(sign * value_of(stage.free_slip), value_of(c.reference_speed), value_of(l),
                      value_of(k)));
    // One Newton step in T leaves the value unchanged and makes the derivatives exact.
    const T up = c.reference_speed * exp(u - l);
    const T down = c.reference_speed * exp(-u - l);
    u -= (up - down + k * u - sign * stage.free_slip) * (1.0 / value_of(up + down + k));
    out.slip = sign * c.reference_speed * (exp(u - l) - exp(-u - l));
  }
  out.theta = sign * stage.backbone * c.direct_share * u;
  out.force = stage.level * out.theta;
}

}  // namespace stickslip::physics
