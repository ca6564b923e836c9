// SPDX-License-Identifier: Apache-2.0
// Closed-loop control of the excitation amplitude: compensates the shaker's gain from the measured
// motion of the base. Without I/O.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "config/rig.h"

namespace stickslip::daemon {

struct Drive;

/// Why the gain is held, or may not rise.
enum class Hold : std::uint8_t {
  none,            ///< not held
  limited,         ///< the drive is limited
  ramping,         ///< the drive ramps up or down
  amplifier_off,   ///< the base is not driven
  no_measurement,  ///< the base's channel is invalid
  no_signal,       ///< the commanded amplitude is too small
  implausible,     ///< required gain far outside its range: dead sensor, disconnected shaker
  saturated,       ///< distorted motion: the gain does not rise
};

/// "saturated", ...
const char* name_of(Hold hold);

/// Once per carrier period (or more, if a period has few samples) the measured motion is fitted by
/// an offset, the drive's carrier with its modulation, and their second and third harmonics. The
/// ratio of fitted to commanded amplitude sets the rate of the logarithm of the gain for the
/// following period; docs/excitation.md has the control law. Owns no heap memory.
class AmplitudeControl {
 public:
  AmplitudeControl(const config::AmplitudeControl& settings, double period_s);

  /// One cycle: `measured` is the displacement of the base [m], or the force [N], while `drive` was
  /// applied. A `reason` other than Hold::none holds the gain.
  void update(double measured, bool valid, const Drive& drive, Hold reason);

  double gain() const { return gain_; }
  /// Why the gain was held at the latest update.
  Hold hold() const { return hold_; }
  /// Measured over commanded amplitude, from the latest fit; 0 before the first.
  double ratio() const { return ratio_; }
  /// Second and third harmonic over the fundamental, from the latest fit.
  double distortion() const { return distortion_; }

 private:
  static constexpr int terms = 7;  // 1, and sine and cosine of the carrier and two harmonics
  using Vector = Eigen::Matrix<double, terms, 1>;
  using Matrix = Eigen::Matrix<double, terms, terms>;

  void discard();
  void add(double measured, const Drive& drive);
  void evaluate(double carrier_hz);
  void follow(double ratio, double relative_std, double distortion, double block_s);

  config::AmplitudeControl settings_;
  double period_s_;
  double gain_ = 1.0;
  double rate_per_s_ = 0.0;   // of the logarithm of the gain, until the next fit
  double drift_per_s_ = 0.0;  // integral part, which compensates a drift
  Hold hold_ = Hold::none;
  double ratio_ = 0.0;
  double distortion_ = 0.0;

  // Normal equations of the current block.
  Matrix normal_ = Matrix::Zero();
  Vector right_ = Vector::Zero();
  double squares_ = 0.0;
  double unit_ = 0.0;  // amplitude that scales the terms to about 1
  int samples_ = 0;
  int missing_ = 0;
  bool discarded_ = true;  // block not started at a period, or gain held
  double phase_turns_ = 0.0;
};

}  // namespace stickslip::daemon
