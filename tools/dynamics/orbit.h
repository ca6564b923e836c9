// SPDX-License-Identifier: Apache-2.0
// A rig under a periodic drive, integrated step by step: the basis of Poincaré sections, exponents
// and bifurcation diagrams.
#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "physics/model.h"
#include "physics/rig.h"

namespace stickslip::dynamics {

/// A drive a cos(omega t) cos(modulation t) of the mass, as the acceleration of the
/// free mass [m/s2]: -b'' of a base-excited rig, F / m of a force-excited one. For the paper's
/// nondimensional equations it is the right-hand side a(t).
struct Drive {
  double acceleration_m_s2 = 0.0;  ///< a
  double omega_rad_s = 1.0;
  double modulation_rad_s = 0.0;

  double period_s() const { return 2.0 * std::numbers::pi / omega_rad_s; }
  double at(double time_s) const {
    return acceleration_m_s2 * std::cos(omega_rad_s * time_s) * std::cos(modulation_rad_s * time_s);
  }
};

/// The drive of a base that moves as amplitude cos(omega t).
Drive base_drive(double amplitude_m, double frequency_hz);

/// A state and its time.
struct Point {
  double time_s = 0.0;
  physics::RigState<double> state;

  double x() const { return state.s[physics::state::x]; }
  double v() const { return state.s[physics::state::v]; }
};

/// One rig in motion. The step divides the drive's period, so every section is met exactly.
class Orbit {
 public:
  /// Starts at rest at deflection `x_m` and velocity `v_m_s` at time 0. Throws
  /// std::invalid_argument for a model that is inconsistent or whose motion is imposed, and for
  /// fewer than 16 steps per period.
  Orbit(const physics::Model& model, const Drive& drive, int steps_per_period, double x_m = 0.0,
        double v_m_s = 0.0);

  /// One step.
  void step();
  /// This number of whole drive periods. Throws Failure if the motion diverges.
  void skip(int periods);

  const Point& now() const { return now_; }
  /// Replaces the mechanical state and completes what follows from it.
  void set_state(const std::array<double, physics::max_rig_states>& s);

  /// Sum of the forces on the mass without friction [N]: under Coulomb's law the mass sticks while
  /// friction can balance it.
  double force_without_friction_n() const;
  /// The largest friction force at this instant [N].
  double friction_limit_n() const;

  const physics::Rig& rig() const { return rig_; }
  const Drive& drive() const { return drive_; }
  int steps_per_period() const { return steps_per_period_; }
  double step_s() const { return step_s_; }

 private:
  physics::Input input_at(long step) const;

  physics::Rig rig_;
  physics::RigNumbers<double> numbers_;
  Drive drive_;
  int steps_per_period_;
  double step_s_;
  long steps_ = 0;
  Point now_;
};

/// Steps of one drive period, and of all periods together, that an integration may take.
inline constexpr double most_steps_per_period = 2.0e6;
double most_steps_of(double periods);

/// Steps per drive period that resolve the rig's fastest free motion, and the drive by 500. Throws
/// InputError where they are too many for so many periods.
int enough_steps(const physics::Model& model, const Drive& drive, int periods = 1);

}  // namespace stickslip::dynamics
