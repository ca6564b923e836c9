// The prediction of any rig: the rig's own integrator in numbers that carry their derivatives.
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
  void fill_memory_transition();
  void fill_transition();
  void pass(const Vector& mean, double time_s, int offset);
  physics::Dual seed(const Vector& mean, int index, int offset) const;

  int steps_;
  bool quasi_static_;
  std::array<physics::FilterChain, channel_count> chains_;
  Matrix by_core_;  ///< d states' / d core
  Matrix memory_;   ///< d tail' / d tail; the chains' own memories, which never change
};

}  // namespace stickslip::observer
