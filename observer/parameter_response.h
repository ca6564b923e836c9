// SPDX-License-Identifier: Apache-2.0
// Change of the filter's states over one period for an error of one standard deviation of each of
// the rig's parameters that are no states of the filter.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "observer/covariance.h"
#include "observer/layout.h"
#include "physics/model.h"
#include "physics/rig.h"

namespace stickslip::observer {

/// The parameters with a standard deviation that are no states.
struct UncertainParameters {
  std::vector<std::string> paths;  ///< as physics::parameters_of() names them
  /// The equations' numbers with derivatives by the parameters in order, each for
  /// physics::Dual::directions of them.
  std::vector<physics::RigNumbers<physics::Dual>> numbers;
};
UncertainParameters uncertain_parameters(physics::Model model, const physics::Rig& rig,
                                         const Layout& layout);

class ParameterResponse {
 public:
  virtual ~ParameterResponse() = default;
  ParameterResponse(const ParameterResponse&) = delete;
  ParameterResponse& operator=(const ParameterResponse&) = delete;

  int count() const { return static_cast<int>(paths_.size()); }
  /// Groups of four parameters.
  int groups() const { return static_cast<int>(changes_.size()); }
  const std::vector<std::string>& paths() const { return paths_; }

  /// The states that depend on the parameters directly.
  const std::vector<int>& rows() const { return rows_; }

  /// The period from the states `before` at `time_s` to `after`. `transition_speed_m_s`: of the
  /// mean of the backbone (Prediction::advance).
  virtual void update(const Vector& before, const Vector& after, double time_s,
                      double transition_speed_m_s) = 0;

  /// Changes of rows() in that period.
  const std::vector<ParameterLanes>& changes(int group) const {
    return changes_[static_cast<std::size_t>(group)];
  }
  /// Direct change of the normal load, besides those by the states.
  const ParameterLanes& load(int group) const { return load_[static_cast<std::size_t>(group)]; }

 protected:
  ParameterResponse(std::vector<std::string> paths, const physics::Model& model,
                    const physics::Rig& rig, const Layout& layout, double period_s);

  struct RigChanges {
    std::array<ParameterLanes, physics::max_rig_states> state;
    ParameterLanes friction, theta;
    ParameterLanes force_reading, load_reading;  ///< inputs of their chains, at the end
    ParameterLanes load;
  };
  void store(int group, const RigChanges& changes);

  const physics::Rig* rig_;
  const Layout* layout_;
  double period_s_;

 private:
  void add_rows(const physics::Model& model);
  void add_chain(const Chain& chain, const physics::Sensor& sensor, ParameterLanes RigChanges::*in);

  std::vector<std::string> paths_;
  std::vector<int> rows_;
  std::vector<std::vector<ParameterLanes>> changes_;
  std::vector<ParameterLanes> load_;
  /// Chains whose input depends on the parameters directly, and their states' responses to an
  /// input of one over a period.
  struct DrivenChain {
    ParameterLanes RigChanges::*input;
    std::vector<double> response;
  };
  std::vector<DrivenChain> chains_;
};

/// For every rig: a pass of the rig's own integrator in dual numbers.
class IntegratedResponse final : public ParameterResponse {
 public:
  /// `rig` and `layout` must outlive it.
  IntegratedResponse(UncertainParameters parameters, const physics::Model& model,
                     const physics::Rig& rig, const Layout& layout, double period_s);

  void update(const Vector& before, const Vector& after, double time_s,
              double transition_speed_m_s) override;

 private:
  physics::Input input_at(const Vector& mean, double after_s) const;
  void set_states(const Vector& mean, physics::RigNumbers<physics::Dual>& numbers);
  void collect(int pass);

  int steps_;
  std::vector<physics::RigNumbers<physics::Dual>> numbers_;
  physics::RigState<physics::Dual> state_;
  physics::Quantities<physics::Dual> quantities_;
};

}  // namespace stickslip::observer
