// SPDX-License-Identifier: Apache-2.0
#include "daemon/base_limits.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace stickslip::daemon {
namespace {

/// Time in which commands that are not finite bring the motion from its limit to 0.
constexpr double fade_s = 1.0;
/// Relative reserve of the planned braking, for rounding errors.
constexpr double min_reserve = 1e-9;
constexpr double largest_reserve = 1e-3;
/// Largest gap, so that its square does not overflow.
constexpr double farthest_gap = 1e100;

double towards_zero(double value, double step) {
  return value > 0.0 ? std::max(0.0, value - step) : std::min(0.0, value + step);
}

}  // namespace

double braking_step(double distance, double change) {
  // A step r with n = floor(r / change) further ones after it covers (n + 1) r - change n (n + 1) /
  // 2. That is continuous in r: an n that rounding makes one too large or small costs nothing.
  if (!std::isfinite(change)) return distance;
  const double n = std::floor((std::sqrt(1.0 + 8.0 * distance / change) - 1.0) / 2.0);
  return n > 0.0 ? distance / (n + 1.0) + change * n / 2.0 : distance;
}

const char* name_of(Limit limit) {
  switch (limit) {
    case Limit::none:
      return "none";
    case Limit::displacement:
      return "displacement";
    case Limit::velocity:
      return "velocity";
    case Limit::acceleration:
      return "acceleration";
    case Limit::not_finite:
      return "not finite";
  }
  return "";
}

BaseLimits::BaseLimits(const MotionLimits& limits, double period_s) : most_(limits.displacement) {
  if (!(limits.displacement > 0.0) || !(limits.velocity > 0.0) || !(limits.acceleration > 0.0) ||
      !(period_s > 0.0)) {
    throw std::invalid_argument("limits of motion and the period must be above 0");
  }
  // Differences of values as large as X are exact to some roundings of X.
  const double rounding =
      std::isfinite(most_) ? 8.0 * std::numeric_limits<double>::epsilon() * most_ : 0.0;
  stride_ = limits.velocity * period_s - rounding;
  change_ = limits.acceleration * period_s * period_s - rounding;
  const double reserve = std::max(min_reserve, 8.0 * rounding / change_);
  if (!(stride_ > 0.0) || !(change_ > 0.0) || reserve > largest_reserve) {
    throw std::invalid_argument("the limit of acceleration is too small for this period");
  }
  plan_change_ = change_ * (1.0 - reserve);
  farthest_ = std::min(4.0 * (most_ + stride_), farthest_gap);
  fade_ = std::isfinite(most_) ? most_ * period_s / fade_s : most_;
}

void BaseLimits::reset() {
  x_ = 0.0;
  step_ = 0.0;
  wanted_ = 0.0;
  following_ = true;
  substituting_ = false;
  limited_ = Limit::none;
}

/// Position first, then velocity, then acceleration: if rounding makes them inconsistent, the later
/// one wins, at the expense of the earlier one's reserve.
BaseLimits::Range BaseLimits::allowed_steps() const {
  Range range;
  const auto tighten = [](Bound& bound, double step, Limit by) {
    if (step < bound.step) bound = {step, by};
  };
  range.high = {braking_step(std::max(0.0, most_ - x_), plan_change_), Limit::displacement};
  range.low = {braking_step(std::max(0.0, most_ + x_), plan_change_), Limit::displacement};
  tighten(range.high, stride_, Limit::velocity);
  tighten(range.low, stride_, Limit::velocity);
  tighten(range.high, step_ + change_, Limit::acceleration);
  tighten(range.low, change_ - step_, Limit::acceleration);
  range.high.step = std::max(range.high.step, step_ - change_);
  range.low.step = std::max(range.low.step, -step_ - change_);
  return range;
}

double BaseLimits::substitute() {
  const double from = substituting_ ? towards_zero(wanted_, fade_) : x_;
  substituting_ = true;
  following_ = false;
  return from;
}

double BaseLimits::next(double wanted) {
  const bool finite = std::isfinite(wanted);
  const double command = finite ? wanted : substitute();
  if (finite) substituting_ = false;

  const double step = command - x_;
  bool joins = following_;
  double chosen = step;
  if (!following_) {
    // In the frame of the command, which moves by `pace` a cycle, come to rest at it. Half of the
    // acceleration is reserved for the command's own.
    const double pace = std::clamp(command - wanted_, -stride_, stride_);
    const double gap = std::clamp(step - pace, -farthest_, farthest_);
    const double half = change_ / 2.0;
    joins = std::abs(gap) <= half;
    if (!joins) chosen = pace + std::copysign(braking_step(std::abs(gap), half), gap);
  }
  wanted_ = command;

  const Range range = allowed_steps();
  double taken = chosen;
  if (chosen > range.high.step) {
    taken = range.high.step;
    limited_ = range.high.by;
  } else if (-chosen > range.low.step) {
    taken = -range.low.step;
    limited_ = range.low.by;
  }
  // By rounding the step may be within the bound and the value beyond it.
  following_ = joins && taken == step && std::abs(command) <= most_;
  const double before = x_;
  x_ = following_ ? command : std::clamp(before + taken, -most_, most_);
  step_ = x_ - before;
  if (!finite) {
    limited_ = Limit::not_finite;
  } else if (following_) {
    limited_ = Limit::none;
  }
  ++counts_[static_cast<std::size_t>(limited_)];
  return x_;
}

}  // namespace stickslip::daemon
