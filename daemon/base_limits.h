// SPDX-License-Identifier: Apache-2.0
// The last stage before the device: limits displacement, velocity and acceleration of the shaker,
// whatever is commanded upstream. Pure: values in, values out.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace stickslip::daemon {

/// The longest step towards a bound `distance` >= 0 away from which steps that shorten by at most
/// `change` > 0 each come to rest before or at the bound. `change` may be infinite.
double braking_step(double distance, double change);

/// Largest absolute values of a motion, each above 0; infinite: no limit. [m], [m/s] and [m/s^2] of
/// base displacement, or [N], [N/s] and [N/s^2] of a force.
struct MotionLimits {
  double displacement = std::numeric_limits<double>::infinity();
  double velocity = std::numeric_limits<double>::infinity();
  double acceleration = std::numeric_limits<double>::infinity();

  friend bool operator==(const MotionLimits&, const MotionLimits&) = default;
};

/// Why a cycle's value differs from the commanded one.
enum class Limit : std::uint8_t { none, displacement, velocity, acceleration, not_finite };
inline constexpr std::size_t limit_count = 5;

/// "displacement", ...; "none".
const char* name_of(Limit limit);

/// Turns any sequence of values into one within the limits, as differences over one period:
///   |x_k| <= X,  |x_k - x_(k-1)| <= V h,  |x_k - 2 x_(k-1) + x_(k-2)| <= A h^2,
/// from rest at 0. A sequence within the limits passes bit-identically. Any other is followed as
/// closely as the limits allow and rejoined without overshoot. Values that are not finite hold the
/// motion and bring it to 0 within a second. docs/excitation.md has the proof. Owns no heap memory.
class BaseLimits {
 public:
  /// Throws std::invalid_argument if a limit or the period is not above 0, or if A h^2 is lost in
  /// the rounding of X.
  BaseLimits(const MotionLimits& limits, double period_s);

  /// The limited value, one period later, where `wanted` is commanded.
  double next(double wanted);

  /// At rest at 0 from the next cycle on: the amplifier was switched off, which is no motion.
  void reset();

  double value() const { return x_; }
  /// True if at 0 and able to rest there in the next cycle.
  bool is_at_zero() const { return x_ == 0.0 && step_ <= change_ && -step_ <= change_; }
  /// The limit that was active in the latest cycle.
  Limit limited() const { return limited_; }
  /// Number of cycles by Limit; `none`: not limited.
  const std::array<std::uint64_t, limit_count>& counts() const { return counts_; }

 private:
  struct Bound {
    double step = 0.0;  // length
    Limit by = Limit::none;
  };
  struct Range {
    Bound low;   // downwards
    Bound high;  // upwards
  };
  Range allowed_steps() const;
  double substitute();

  double most_ = 0.0;          // X
  double stride_ = 0.0;        // longest step
  double change_ = 0.0;        // largest change of a step
  double plan_change_ = 0.0;   // for planning: slightly less
  double farthest_ = 0.0;      // gaps are clamped to this
  double fade_ = 0.0;          // of a value that is not finite, per cycle
  double x_ = 0.0;             // latest output
  double step_ = 0.0;          // the step that led to it
  double wanted_ = 0.0;        // latest command or its substitute
  bool following_ = true;      // x_ is the commanded value
  bool substituting_ = false;  // the command was not finite
  Limit limited_ = Limit::none;
  std::array<std::uint64_t, limit_count> counts_{};
};

}  // namespace stickslip::daemon
