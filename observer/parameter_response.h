// Change of the filter's states over one period for an error of one standard deviation of each of
// the rig's parameters, by one pass of the rig's own integrator in dual numbers.
#pragma once

#include <string>
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

  int count() const { return static_cast<int>(paths_.size()); }
  /// The parameters, as physics::parameters_of() names them.
  const std::vector<std::string>& paths() const { return paths_; }

  /// Number of passes, each for physics::Dual::directions parameters.
  int passes() const { return static_cast<int>(numbers_.size()); }

  /// The states that depend on the parameters directly.
  const std::vector<int>& rows() const { return rows_; }

  using Changes = std::vector<physics::Dual::Derivatives>;
  /// The period that begins with the states `mean` at `time_s`: the changes of rows(), in the order
  /// of the parameters. `transition_speed_m_s`: of the mean of the backbone (Prediction::advance).
  /// Valid until the next call.
  const Changes& of(int pass, const Vector& mean, double time_s, double transition_speed_m_s);
  /// Change of the normal load in the last period.
  const physics::Dual::Derivatives& load() const { return state_.load.d; }

 private:
  void add_chain(Channel channel, const physics::Sensor& sensor);
  void add_rows(const physics::Model& model);
  void collect();
  physics::Input input_at(const Vector& mean, double after_s) const;
  void set_states(const Vector& mean, physics::RigNumbers<physics::Dual>& numbers);

  const physics::Rig* rig_;
  const Layout* layout_;
  double period_s_;
  int steps_;
  std::vector<std::string> paths_;
  std::vector<physics::RigNumbers<physics::Dual>> numbers_;
  physics::RigState<physics::Dual> state_;
  physics::Quantities<physics::Dual> quantities_;
  std::vector<int> rows_;
  Changes changes_;
  /// Chains whose input depends on the parameters directly, and their states' responses to an
  /// input of one over a period.
  struct DrivenChain {
    physics::Dual physics::Quantities<physics::Dual>::*input;
    std::vector<double> response;
  };
  std::vector<DrivenChain> chains_;
};

}  // namespace stickslip::observer
