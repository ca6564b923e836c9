// Change of the rig's states over one period for an error of one standard deviation of each of its
// parameters, by one pass of the rig's own integrator in dual numbers.
#pragma once

#include <vector>

#include "observer/layout.h"
#include "physics/model.h"
#include "physics/rig.h"

namespace stickslip::observer {

class ParameterResponse {
 public:
  /// Of the parameters with a standard deviation that are no states of the filter. `rig` and
  /// `layout` must outlive it.
  ParameterResponse(physics::Model model, const physics::Rig& rig, const Layout& layout,
                    double period_s);

  int count() const { return count_; }

  /// Number of passes, each for physics::Dual::directions parameters.
  int passes() const { return static_cast<int>(numbers_.size()); }

  /// The period that begins with the states `mean` at `time_s`. The derivatives of the returned
  /// state are its changes, in the order of the parameters. `transition_speed_m_s`: of the mean of
  /// the backbone (Prediction::advance). Valid until the next call.
  const physics::RigState<physics::Dual>& of(int pass, const Vector& mean, double time_s,
                                             double transition_speed_m_s);

 private:
  physics::Input input_at(const Vector& mean, double after_s) const;
  void set_states(const Vector& mean, physics::RigNumbers<physics::Dual>& numbers);

  const physics::Rig* rig_;
  const Layout* layout_;
  double period_s_;
  int steps_;
  int count_ = 0;
  std::vector<physics::RigNumbers<physics::Dual>> numbers_;
  physics::RigState<physics::Dual> state_;
};

}  // namespace stickslip::observer
