// SPDX-License-Identifier: Apache-2.0
// Prediction for any rig: the rig's own integrator in dual numbers (forward automatic
// differentiation).
#pragma once

#include <array>

#include "observer/chain_memory.h"
#include "observer/prediction.h"

namespace stickslip::observer {

class DualPrediction final : public Prediction {
 public:
  /// `steps`: integration steps in a period.
  DualPrediction(const physics::Rig& rig, const physics::Model& model, const Layout& layout,
                 double period_s, int steps);

  void advance(Vector& mean, double time_s, double slip_variance) override;

 private:
  bool is_base_excited() const { return excitation_ == physics::Excitation::base; }

  /// States in dual numbers during a period.
  struct DualStates {
    physics::RigState<physics::Dual> rig;
    physics::Dual mu;
    physics::Dual load{1.0};
    physics::Dual load_rate{0.0};
    std::array<physics::Dual, 4> drive;
    physics::Quantities<physics::Dual> quantities;
    std::array<physics::FilterMemory<physics::Dual>, channel_count> memory;
  };

  void fill_memory_transition();
  void fill_transition();
  /// Propagates the mean, and the derivatives by the core states from `offset` on.
  void propagate(const Vector& mean, double time_s, int offset);
  void load_states(const Vector& mean, int offset, DualStates& s);
  void load_chains(const Vector& mean, DualStates& s) const;
  void step(DualStates& s, double time_s);
  void apply_input_derivatives(DualStates& s, const std::array<physics::Dual, 4>& drive_before,
                               double h) const;
  void advance_chains(DualStates& s) const;
  void store_states(const Vector& mean, int offset, const DualStates& s);
  physics::Dual seed(const Vector& mean, int index, int offset) const;
  physics::Input input_of(const DualStates& s) const;
  void set_measured_load(const physics::Dual& mu, const physics::Dual& load);
  physics::Dual friction_reading(const DualStates& s) const;
  physics::Dual load_reading(const DualStates& s) const;

  int steps_;
  bool quasi_static_;
  physics::Excitation excitation_;
  std::array<physics::FilterChain, channel_count> chains_;
  Matrix by_core_;  ///< d states' / d core
  Matrix memory_;   ///< d outputs' / d outputs: the memory of the chains, which is constant
};

}  // namespace stickslip::observer
