// SPDX-License-Identifier: Apache-2.0
#include "tools/dynamics/orbit.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "physics/failure.h"
#include "physics/integration_cost.h"
#include "physics/number_text.h"
#include "physics/problem.h"

namespace stickslip::dynamics {

Drive base_drive(double amplitude_m, double frequency_hz) {
  Drive drive;
  drive.omega_rad_s = 2.0 * std::numbers::pi * frequency_hz;
  drive.acceleration_m_s2 = amplitude_m * drive.omega_rad_s * drive.omega_rad_s;
  return drive;
}

Orbit::Orbit(const physics::Model& model, const Drive& drive, int steps_per_period, double x_m,
             double v_m_s)
    : rig_(model),
      numbers_(rig_.numbers<double>(rig_.parameter_values())),
      drive_(drive),
      steps_per_period_(steps_per_period),
      step_s_(drive.period_s() / steps_per_period) {
  if (rig_.structure().excitation == physics::Excitation::imposed) {
    throw std::invalid_argument("a rig with imposed motion has no orbits");
  }
  if (steps_per_period < 16) {
    throw std::invalid_argument("an orbit requires at least 16 steps per drive period, not " +
                                std::to_string(steps_per_period));
  }
  std::array<double, physics::max_rig_states> s{};
  s[physics::state::x] = x_m;
  s[physics::state::v] = v_m_s;
  set_state(s);
}

physics::Input Orbit::input_at(long step) const {
  const double a = drive_.at(static_cast<double>(step) * step_s_);
  physics::Input input;
  if (rig_.structure().excitation == physics::Excitation::force) {
    input.drive_force_n = a * numbers_.c.mass;
  } else {
    input.base_acceleration_m_s2 = -a;
  }
  return input;
}

void Orbit::set_state(const std::array<double, physics::max_rig_states>& s) {
  now_.state.s = s;
  rig_.complete(now_.state, input_at(steps_), now_.time_s, numbers_);
}

void Orbit::step() {
  rig_.step(now_.state, input_at(steps_), input_at(steps_ + 1), now_.time_s, step_s_, numbers_);
  ++steps_;
  now_.time_s = static_cast<double>(steps_) * step_s_;
}

void Orbit::skip(int periods) {
  for (int period = 0; period < periods; ++period) {
    for (int k = 0; k < steps_per_period_; ++k) step();
    if (!std::isfinite(now_.x()) || !std::isfinite(now_.v())) {
      throw Failure("the motion diverges before time " + physics::number_text(now_.time_s) +
                    " s: the steps are too long, or the rig is unstable");
    }
  }
}

double Orbit::force_without_friction_n() const {
  const auto& c = numbers_.c;
  const double x = now_.x();
  const double spring =
      rig_.structure().two_well ? x * (c.well_cubic * x * x - c.well_linear) : c.stiffness * x;
  return c.mass * drive_.at(now_.time_s) - spring - c.damping * now_.v();
}

double Orbit::friction_limit_n() const {
  return numbers_.c.mu * (rig_.structure().loaded ? now_.state.load : 1.0);
}

// A thousand steps per period are what the drive needs, however many periods are wanted.
double most_steps_of(double periods) { return std::max(physics::most_steps, 1000.0 * periods); }

int enough_steps(const physics::Model& model, const Drive& drive, int periods) {
  const physics::Rig rig(model);
  // longest_step_s is bounded by a millisecond, which is meaningless for a nondimensional rig.
  const auto n = rig.numbers<double>(rig.parameter_values());
  double fastest = std::sqrt(std::max(n.c.stiffness, 2.0 * n.c.well_linear) / n.c.mass);
  if (rig.structure().resonant) {
    fastest = std::max(fastest, std::sqrt(n.c.cell_stiffness / n.c.cell_mass));
  }
  constexpr double longest_angle = 0.02;
  // A decay needs no accuracy: steps as long as its time constant are stable.
  fastest = std::max(fastest, longest_angle * n.c.damping / n.c.mass);
  const double by_rig = std::ceil(drive.period_s() * fastest / longest_angle);
  std::string wrong =
      physics::wrong_with_steps(model, by_rig, "a drive period", most_steps_per_period);
  if (wrong.empty()) {
    wrong = physics::wrong_with_steps(
        model, by_rig * periods, physics::counted(periods, "drive period"), most_steps_of(periods));
  }
  if (!wrong.empty()) {
    throw InputError(Problem{"", 0, 0,
                             wrong + " Otherwise take a faster drive, fewer periods, or a fixed "
                                     "number of steps per period"});
  }
  return std::max(500, static_cast<int>(by_rig));
}

}  // namespace stickslip::dynamics
