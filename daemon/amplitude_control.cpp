// SPDX-License-Identifier: Apache-2.0
#include "daemon/amplitude_control.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "daemon/excitation.h"

namespace stickslip::daemon {
namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;
/// Of a block; with fewer samples to a period, a block takes several periods.
constexpr int min_samples = 32;
/// Time constant in blocks: an integrator with a delay of one block does not ring above it.
constexpr double min_blocks = 3.0;
constexpr double largest_error = 0.5;
/// The integral part is active only for small errors, so that a step does not overshoot.
constexpr double drift_error = 0.03;
constexpr double largest_drift_per_s = 0.03;
/// Relative standard deviation of a fitted amplitude that halves its weight.
constexpr double reference_std = 0.01;
/// Factor by which the required gain may exceed its range.
constexpr double plausible = 2.0;
/// Largest carrier frequency, over the sampling rate, at which harmonics are fitted.
constexpr double highest_carrier = 1.0 / 16.0;

}  // namespace

const char* name_of(Hold hold) {
  switch (hold) {
    case Hold::none:
      return "none";
    case Hold::limited:
      return "limited";
    case Hold::ramping:
      return "ramping";
    case Hold::amplifier_off:
      return "amplifier off";
    case Hold::no_measurement:
      return "no measurement";
    case Hold::no_signal:
      return "no signal";
    case Hold::implausible:
      return "implausible";
    case Hold::saturated:
      return "saturated";
  }
  return "";
}

AmplitudeControl::AmplitudeControl(const config::AmplitudeControl& settings, double period_s)
    : settings_(settings), period_s_(period_s) {}

void AmplitudeControl::discard() {
  normal_.setZero();
  right_.setZero();
  squares_ = 0.0;
  unit_ = 0.0;
  samples_ = 0;
  missing_ = 0;
  discarded_ = false;
}

void AmplitudeControl::update(double measured, bool valid, const Drive& drive, Hold reason) {
  const bool new_period = drive.phase_turns < phase_turns_;
  phase_turns_ = drive.phase_turns;
  const bool usable = valid && std::isfinite(measured);
  if (reason != Hold::none) {
    discarded_ = true;
    rate_per_s_ = 0.0;
    drift_per_s_ = 0.0;
    hold_ = reason;
  } else if (usable) {
    gain_ = std::clamp(gain_ * std::exp(rate_per_s_ * period_s_), settings_.gain_min,
                       settings_.gain_max);
  }
  if (new_period && (discarded_ || samples_ + missing_ >= min_samples)) {
    if (!discarded_) evaluate(drive.carrier_hz);
    discard();
    discarded_ = reason != Hold::none;
  }
  if (discarded_) return;
  if (usable) {
    add(measured, drive);
  } else {
    ++missing_;
  }
}

void AmplitudeControl::add(double measured, const Drive& drive) {
  if (unit_ == 0.0) unit_ = drive.amplitude;
  const double a = unit_ > 0.0 ? drive.amplitude / unit_ : 0.0;
  const double s = std::sin(two_pi * drive.phase_turns);
  const double c = std::cos(two_pi * drive.phase_turns);
  const double s2 = 2.0 * s * c;
  const double c2 = c * c - s * s;
  Vector row;
  row << 1.0, a * s, a * c, a * s2, a * c2, a * (s2 * c + c2 * s), a * (c2 * c - s2 * s);
  normal_.noalias() += row * row.transpose();
  right_.noalias() += row * measured;
  squares_ += measured * measured;
  ++samples_;
}

void AmplitudeControl::evaluate(double carrier_hz) {
  rate_per_s_ = 0.0;
  if (samples_ < min_samples / 2 || missing_ * 10 > samples_) {
    hold_ = Hold::no_measurement;
    drift_per_s_ = 0.0;
    return;
  }
  const double block_s = (samples_ + missing_) * period_s_;
  const double fundamental = std::min(normal_(1, 1), normal_(2, 2));
  if (!(unit_ > 0.0) || fundamental < 1e-6 * samples_) {
    hold_ = Hold::no_signal;
    return;
  }
  // Aliased harmonics are left out of the fit.
  if (carrier_hz * period_s_ > highest_carrier) {
    for (int i = 3; i < terms; ++i) {
      normal_.row(i).setZero();
      normal_.col(i).setZero();
      normal_(i, i) = 1.0;
      right_(i) = 0.0;
    }
  }
  const Eigen::LDLT<Matrix> solver(normal_);
  const Vector fit = solver.solve(right_);
  const double level = std::hypot(fit(1), fit(2));
  const double residual_variance = std::max(0.0, squares_ - fit.dot(right_)) / (samples_ - terms);
  const Vector sine_covariance = solver.solve(Vector::Unit(1));
  if (!fit.allFinite() || !(level > 0.0)) {
    hold_ = Hold::implausible;
    drift_per_s_ = 0.0;
    return;
  }
  const double relative_std =
      std::sqrt(residual_variance * std::max(0.0, sine_covariance(1))) / level;
  const double harmonics = std::sqrt(fit.tail<4>().squaredNorm());
  follow(level / unit_, relative_std, harmonics / level, block_s);
}

void AmplitudeControl::follow(double ratio, double relative_std, double distortion,
                              double block_s) {
  ratio_ = ratio;
  distortion_ = distortion;
  const double needed = gain_ / ratio;
  if (needed > plausible * settings_.gain_max || needed < settings_.gain_min / plausible) {
    hold_ = Hold::implausible;
    drift_per_s_ = 0.0;
    return;
  }
  const double error = std::clamp(-std::log(ratio), -largest_error, largest_error);
  if (error > 0.0 && distortion > settings_.distortion_max) {
    hold_ = Hold::saturated;
    drift_per_s_ = 0.0;
    return;
  }
  hold_ = Hold::none;
  const double weight = 1.0 / (1.0 + relative_std * relative_std / (reference_std * reference_std));
  const double time_s = std::max(settings_.time_constant_s, min_blocks * block_s);
  if (std::abs(error) < drift_error) {
    drift_per_s_ = std::clamp(drift_per_s_ + weight * error * block_s / (4.0 * time_s * time_s),
                              -largest_drift_per_s, largest_drift_per_s);
  }
  const bool at_end =
      (error > 0.0 && gain_ >= settings_.gain_max) || (error < 0.0 && gain_ <= settings_.gain_min);
  if (at_end) drift_per_s_ = 0.0;
  rate_per_s_ = weight * error / time_s + drift_per_s_;
}

}  // namespace stickslip::daemon
