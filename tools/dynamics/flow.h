// The motion of a rig under a drive that is known for all times, fast: what long runs of orbits are
// made of. Beside physics::Rig's step, which must serve unknown inputs, derivatives and added
// terms, this solver knows the drive ahead, chooses its steps and finds the instants at which a
// set-valued contact sticks and slips.
#pragma once

#include <memory>

#include "physics/model.h"
#include "tools/dynamics/orbit.h"

namespace stickslip::dynamics {

class Flow {
 public:
  /// Whether a flow can follow the model: no added terms, a friction law with tanh and memory or a
  /// set-valued one (or none), a rate that does not make the equations stiff, a load that is not
  /// taken from a measurement, and no imposed motion.
  static bool can_follow(const physics::Model& model);

  /// Starts at rest at deflection `x_m` and velocity `v_m_s` at time 0. `tolerance` is the error of
  /// a step over the largest values of each state so far. Throws std::invalid_argument for a model
  /// that it cannot follow.
  Flow(const physics::Model& model, const Drive& drive, double tolerance = 1.0e-7, double x_m = 0.0,
       double v_m_s = 0.0);
  ~Flow();
  Flow(Flow&&) noexcept;
  Flow& operator=(Flow&&) noexcept;

  /// Starts again, at time 0.
  void start(double x_m, double v_m_s);

  /// Moves on to `time_s`, which is not before now, exactly. Throws std::runtime_error where the
  /// motion leaves every bound.
  void advance(double time_s);

  /// The state now, with load, slip and friction.
  const Point& now() const;

  /// One set of equations with its solver.
  class Solver;

 private:
  std::unique_ptr<Solver> solver_;
};

}  // namespace stickslip::dynamics
