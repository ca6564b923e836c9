// SPDX-License-Identifier: Apache-2.0
// A fast solver for the motion of a rig under a drive that is known for all times. Unlike
// physics::Rig::step, which serves unknown inputs, derivatives and added terms, it knows the drive
// in advance, adapts its steps and locates the instants at which a set-valued contact sticks and
// slips.
#pragma once

#include <memory>

#include "physics/model.h"
#include "tools/dynamics/orbit.h"

namespace stickslip::dynamics {

class Flow {
 public:
  /// True for a model without added terms and imposed motion, with a declared normal load, and with
  /// no friction law, a set-valued one, or a smooth one whose rate does not make the equations
  /// stiff.
  static bool can_follow(const physics::Model& model);

  /// Starts at rest at deflection `x_m` and velocity `v_m_s` at time 0. `tolerance` is the error of
  /// a step relative to the largest values of each state so far. Throws std::invalid_argument
  /// unless can_follow(model).
  Flow(const physics::Model& model, const Drive& drive, double tolerance = 1.0e-7, double x_m = 0.0,
       double v_m_s = 0.0);
  ~Flow();
  Flow(Flow&&) noexcept;
  Flow& operator=(Flow&&) noexcept;

  /// Restarts at time 0.
  void start(double x_m, double v_m_s);

  /// Integrates to exactly `time_s`, not before the current time. Throws Failure if the
  /// motion diverges.
  void advance(double time_s);

  /// The current state, with load, slip and friction.
  const Point& now() const;

  /// One set of equations with its solver.
  class Solver;

 private:
  std::unique_ptr<Solver> solver_;
};

}  // namespace stickslip::dynamics
