// The shaker's own gain made up for: what the base really does, held against what was asked for.
// Pure: values in, a gain out.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "config/rig.h"

namespace stickslip::daemon {

struct Drive;

/// Why the gain stands still, or may not rise.
enum class Hold : std::uint8_t {
  none,            ///< it follows
  limited,         ///< the last stage changed what was asked for
  ramping,         ///< the drive starts or stops
  amplifier_off,   ///< nothing moves the base
  no_measurement,  ///< the base's channel is invalid
  no_signal,       ///< too little was asked for to tell
  implausible,  ///< the gain would have to be far outside its range: a dead sensor, a loose shaker
  saturated,    ///< the motion is distorted: the gain does not rise
};

/// "saturated", ...
const char* name_of(Hold hold);

/// Once in each period of the carrier (or more, where a period has few samples) the measured motion
/// is fitted by an offset, the drive's own carrier with its own modulation, and their second and
/// third harmonics; the ratio of the fitted amplitude to the one asked for moves the logarithm of
/// the gain, at a steady rate over the period that follows. docs/excitation.md has the law. Owns no
/// heap memory.
class AmplitudeControl {
 public:
  AmplitudeControl(const config::AmplitudeControl& settings, double period_s);

  /// One cycle: `measured` is the base [m], or the force [N], while `drive` was applied; `valid`,
  /// whether it was measured. Other than Hold::none, `because` holds the gain.
  void update(double measured, bool valid, const Drive& drive, Hold because);

  double gain() const { return gain_; }
  /// Why the gain did not follow at the latest occasion.
  Hold hold() const { return hold_; }
  /// Measured over asked for amplitude, by the latest fit; 0 before the first.
  double ratio() const { return ratio_; }
  /// Second and third harmonic over the fundamental, by the latest fit.
  double distortion() const { return distortion_; }

 private:
  static constexpr int terms = 7;  // 1, and sine and cosine of the carrier and two harmonics
  using Vector = Eigen::Matrix<double, terms, 1>;
  using Matrix = Eigen::Matrix<double, terms, terms>;

  void discard();
  void add(double measured, const Drive& drive);
  void evaluate(double carrier_hz);
  void follow(double ratio, double doubt, double distortion, double block_s);

  config::AmplitudeControl settings_;
  double period_s_;
  double gain_ = 1.0;
  double rate_per_s_ = 0.0;   // of the logarithm of the gain, until the next fit
  double drift_per_s_ = 0.0;  // the part of it that makes up for a drift
  Hold hold_ = Hold::none;
  double ratio_ = 0.0;
  double distortion_ = 0.0;

  // The block that is being gathered.
  Matrix normal_ = Matrix::Zero();
  Vector right_ = Vector::Zero();
  double squares_ = 0.0;
  double unit_ = 0.0;  // an amplitude of the block, for terms of the size of 1
  int samples_ = 0;
  int missing_ = 0;
  bool spoilt_ = true;  // it did not begin with a period, or something held the gain in it
  double phase_turns_ = 0.0;
};

}  // namespace stickslip::daemon
