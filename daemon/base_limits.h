// The last stage before the device: whatever stands upstream asks for, the shaker is not told to
// move farther, faster or more suddenly than it may. Pure: values in, values out.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace stickslip::daemon {

/// The longest step towards a wall `room` >= 0 away after which steps that shorten by at most
/// `change` > 0 each still come to rest before the wall, or at it. `change` may be infinite.
double braking_step(double room, double change);

/// What a motion may be at most, each above 0; infinite: no limit. [m], [m/s] and [m/s^2] of base
/// displacement, or [N], [N/s] and [N/s^2] of a force.
struct MotionLimits {
  double displacement = std::numeric_limits<double>::infinity();
  double velocity = std::numeric_limits<double>::infinity();
  double acceleration = std::numeric_limits<double>::infinity();

  friend bool operator==(const MotionLimits&, const MotionLimits&) = default;
};

/// Why a cycle's value is not the one that was asked for.
enum class Limit : std::uint8_t { none, displacement, velocity, acceleration, not_finite };
inline constexpr std::size_t limit_count = 5;

/// "displacement", ...; "none".
const char* name_of(Limit limit);

/// Makes of any sequence of values one that keeps the limits, in differences over one period:
///   |x_k| <= X,  |x_k - x_(k-1)| <= V h,  |x_k - 2 x_(k-1) + x_(k-2)| <= A h^2,
/// from rest at 0. A sequence that keeps them by itself passes to the bit. One that does not is
/// followed as closely as the limits let it, and is joined again without overshoot. A value that is
/// not finite holds the motion where it is and, while it lasts, brings it to 0 within a second.
/// docs/excitation.md says why it cannot fail. Owns no heap memory.
class BaseLimits {
 public:
  /// Throws std::invalid_argument where a limit or the period is not above 0, or where
  /// A h^2 is lost in the rounding of X.
  BaseLimits(const MotionLimits& limits, double period_s);

  /// One period on: what the device may be told where `wanted` is asked for.
  double next(double wanted);

  /// At rest at 0 from the next cycle on: the amplifier was switched off, which is not a motion.
  void reset();

  double value() const { return x_; }
  /// Whether it stands at 0, or could in the next cycle.
  bool is_at_zero() const { return x_ == 0.0 && step_ <= change_ && -step_ <= change_; }
  /// What limited the latest cycle.
  Limit limited() const { return limited_; }
  /// Cycles that each Limit, by its value, has cost; those that were left alone under `none`.
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
  double plan_change_ = 0.0;   // what braking is planned with: a little less
  double farthest_ = 0.0;      // gap that makes a difference
  double fade_ = 0.0;          // of a value that is not finite, per cycle
  double x_ = 0.0;             // what was told
  double step_ = 0.0;          // the step that led to it
  double wanted_ = 0.0;        // what was last asked for, or put in its place
  bool following_ = true;      // x_ is what was asked for
  bool substituting_ = false;  // what was asked for was not finite
  Limit limited_ = Limit::none;
  std::array<std::uint64_t, limit_count> counts_{};
};

}  // namespace stickslip::daemon
