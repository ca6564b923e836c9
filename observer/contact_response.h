// SPDX-License-Identifier: Apache-2.0
// Response to the rig's parameters where ContactPrediction predicts: the derivatives of its linear
// part are computed once, those of its two contact stages follow from their solutions, which are
// not repeated.
#pragma once

#include <array>
#include <vector>

#include "observer/layout.h"
#include "observer/parameter_response.h"
#include "physics/model.h"
#include "physics/rig.h"

namespace stickslip::observer {

/// Solution of one implicit stage of the contact, with derivatives.
struct SolvedStage {
  double theta = 0.0;
  double force_n = 0.0;
  double limit_n = 0.0;  ///< mu N
  double load_n = 0.0;   ///< N
  double load_by_x = 0.0;
  double x = 0.0;
  double by_slip = 0.0;          ///< d theta / d slip velocity without friction
  double by_limit = 0.0;         ///< d theta / d mu N
  double by_theta_before = 0.0;  ///< d theta / d theta before the stage
  double slip_in_speeds = 0.0;   ///< slip velocity in transition speeds
};

struct SolvedContact {
  SolvedStage middle, end;
};

class ContactResponse final : public ParameterResponse {
 public:
  /// `contact`: of the last period. `rig`, `layout` and `contact` must outlive it.
  ContactResponse(UncertainParameters parameters, const physics::Model& model,
                  const physics::Rig& rig, const Layout& layout, double period_s,
                  const SolvedContact& contact);

  void update(const Vector& before, const Vector& after, double time_s,
              double transition_speed_m_s) override;

 private:
  /// Inputs of the motion without friction: the rig's states, the drive and two of its
  /// derivatives, and the forces of both stages. Of further derivatives of the drive the parameters
  /// change nothing that matters.
  enum Input { x, v, y, u, drive, drive_rate, drive_acceleration, middle_force, end_force, inputs };
  /// States at the end of the period, and two at the end of the first stage.
  enum Output { end_x, end_v, end_y, end_u, middle_x, middle_slip, outputs };
  using Inputs = std::array<double, inputs>;

  /// Four parameters.
  struct Group {
    struct Weight {
      Input input;
      ParameterLanes change;
    };
    std::array<std::vector<Weight>, outputs> weights;  ///< those that change
    ParameterLanes mass_of_cell, stiffness_of_cell, load, load_slope, transition_speed;
  };
  using Responses = std::array<std::array<physics::Dual, outputs>, inputs>;

  static Responses responses_of(const physics::Model& model,
                                const physics::RigNumbers<physics::Dual>& numbers, double period_s);
  void add_group(const Responses& responses, const physics::RigNumbers<physics::Dual>& numbers,
                 int first);
  Inputs inputs_of(const Vector& before) const;
  ParameterLanes change_of(const Group& group, Output output, const Inputs& of) const;
  ParameterLanes load_at(const Group& group, double x, double load_n, const Vector& mean) const;
  void close_contact(const Group& group, const Inputs& of, const Vector& mean, RigChanges& out);
  void read(const Group& group, const Vector& after, RigChanges& out);
  double bridge_factor(double displacement_m);

  const SolvedContact* contact_;
  physics::RigNumbers<double> numbers_;
  std::array<std::array<double, outputs>, 2> by_force_{};  ///< of the middle and the end [1/N]
  std::vector<Group> groups_;
  physics::RigState<double> bridge_;
};

}  // namespace stickslip::observer
