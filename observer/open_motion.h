// SPDX-License-Identifier: Apache-2.0
// A rig without contact force, which is linear, over one period in small steps: the source of the
// weights of ContactPrediction and, in dual numbers, of their derivatives by the rig's parameters.
#pragma once

#include <array>
#include <utility>

#include "physics/rig.h"

namespace stickslip::observer {

/// Forces on a rig during one period.
struct Forcing {
  std::array<double, 5> drive{};  ///< p and its derivatives, at the start
  double middle_n = 0.0;          ///< friction before the last stage
  double end_n = 0.0;             ///< friction in the last stage

  double position_at(double t) const {
    const auto& p = drive;
    return p[0] + t * (p[1] + t / 2.0 * (p[2] + t / 3.0 * (p[3] + t / 4.0 * p[4])));
  }
};

template <class T>
class OpenMotion {
 public:
  /// Substeps of a period; 41 of 140 equal the integrator's gamma within 10^-4.
  static constexpr int substeps = 140;
  static constexpr int first_stage_substeps = 41;

  /// `numbers`: of the real rig, whose equations without contact are the same.
  OpenMotion(const physics::Model& model, physics::RigNumbers<T> numbers, double period_s)
      : rig_(without_contact(model)),
        numbers_(std::move(numbers)),
        is_base_excited_(rig_.structure().excitation == physics::Excitation::base),
        step_s_(period_s / substeps) {}

  double step_s() const { return step_s_; }
  const physics::Structure& structure() const { return rig_.structure(); }

  physics::Quantities<T> quantities(const physics::RigState<T>& rig, const Forcing& forcing,
                                    double t) const {
    return rig_.quantities(rig, input_at(forcing, t), numbers_);
  }

  /// One substep, of which `index` have passed.
  void advance(physics::RigState<T>& rig, const Forcing& forcing, int index) const {
    const double t = index * step_s_;
    rig.friction = T(index < substeps - first_stage_substeps ? forcing.middle_n : forcing.end_n);
    kick(rig);
    rig_.step(rig, input_at(forcing, t), input_at(forcing, t + step_s_), t, step_s_, numbers_);
    kick(rig);
  }

  static T slip_of(const physics::RigState<T>& rig) {
    return rig.s[physics::state::v] - rig.s[physics::state::u];
  }

 private:
  static physics::Model without_contact(physics::Model model) {
    model.friction = {};
    model.friction.law = physics::FrictionLaw::none;
    model.normal_load.reset();
    model.normal_load_bridge.reset();
    return model;
  }
  physics::Input input_at(const Forcing& forcing, double t) const {
    const auto& p = forcing.drive;
    physics::Input input;
    input.base_acceleration_m_s2 = p[2] + t * (p[3] + 0.5 * t * p[4]);
    if (!is_base_excited_) input.drive_force_n = forcing.position_at(t);
    return input;
  }
  void kick(physics::RigState<T>& rig) const {
    const T impulse = 0.5 * step_s_ * rig.friction;
    rig.s[physics::state::v] -= impulse * numbers_.inverse_mass;
    rig.s[physics::state::u] += impulse * numbers_.inverse_cell_mass;
  }

  physics::Rig rig_;
  physics::RigNumbers<T> numbers_;
  bool is_base_excited_;
  double step_s_;
};

}  // namespace stickslip::observer
