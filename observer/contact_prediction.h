// SPDX-License-Identifier: Apache-2.0
// Prediction for rigs that are linear except for their contact, such as the paper's. The linear
// part including the sensor chains is propagated exactly, with weights that are computed once by
// integrating the rig's own equations in small steps. A period then only has to solve the contact,
// in the two implicit stages of the rig's integrator.
#pragma once

#include <array>
#include <vector>

#include "observer/contact_response.h"
#include "observer/prediction.h"

namespace stickslip::observer {

class ContactPrediction final : public Prediction {
 public:
  /// True if it can predict such rigs: a linear spring, the paper's friction laws (no bristle), and
  /// no [[physics]] terms.
  static bool supports(const physics::Rig& rig, const physics::Model& model);

  ContactPrediction(const physics::Rig& rig, const physics::Model& model, const Layout& layout,
                    double period_s);

  void advance(Vector& mean, double time_s, double slip_variance) override;
  std::unique_ptr<ParameterResponse> response_to(UncertainParameters parameters,
                                                 const physics::Model& model) const override;

 private:
  /// Core states of the rigs that are supported, in whole registers.
  static constexpr int core_lanes = 16;
  static_assert(physics::state::first_effect + 8 <= core_lanes);
  /// One value per core state, 0 beyond them; not initialised.
  struct Row {
    alignas(32) std::array<double, core_lanes> of;
    double& operator[](int i) { return of[static_cast<std::size_t>(i)]; }
    double operator[](int i) const { return of[static_cast<std::size_t>(i)]; }
  };

  /// A linear form of the core states, plus its terms in the drive's lambda.
  struct LinearForm {
    Row weights = {};                     ///< for lambda = 0
    double by_lambda_rate = 0.0;          ///< of lambda p'
    double by_lambda_acceleration = 0.0;  ///< of lambda p''
  };
  struct ValueAndGradient {
    double value;
    Row gradient;
  };
  /// Normal load, or the reading of its bridge, with derivatives.
  struct Load {
    double value = 1.0;
    double by_x = 0.0;
    double by_load = 0.0;
    double by_load_rate = 0.0;
  };
  struct Stage {
    ValueAndGradient theta;
    ValueAndGradient force;
  };

  void compute_responses(const physics::Model& model);
  void compute_parameter_rows();
  void compute_load_chain(const physics::Model& model);
  Vector scales(double force_n) const;
  void drop_negligible_weights();
  void choose_columns();
  void build_rows();
  void build_linear_row(int row, bool friction, bool load_sensed);
  int add_zero_row();
  void update_drive_terms(const Vector& mean);
  void add_contact(const Vector& mean, double speed);
  void add_load_chain(const Vector& mean, const ValueAndGradient& x_after);

  static void add(Row& to, double weight, const Row& row);
  static void add(ValueAndGradient& to, double weight, const ValueAndGradient& term);
  ValueAndGradient evaluate(const LinearForm& form, const Vector& mean) const;
  Load load_at(double time_s, double x, const Vector& mean);
  Load load_reading(double time_s, double x, const Vector& mean);
  void add_load_gradient(Row& to, double weight, const Load& load, const Row& x) const;
  Stage solve_stage(const ValueAndGradient& free_slip, double compliance, const Load& load,
                    const ValueAndGradient& x, const ValueAndGradient& from, double speed,
                    const Vector& mean, SolvedStage& solved);
  void store(int position, const Row& gradient);

  bool load_varies_;  ///< with x
  Row core_;          ///< core states at the start of the period
  physics::RigState<physics::Dual> dual_state_;

  // Computed once.
  Matrix open_jacobian_;  ///< d states' / d states without contact force, lambda = 0
  Vector by_lambda_rate_, by_lambda_acceleration_;  ///< d states' / d (lambda p'), d (lambda p'')
  Vector by_middle_force_, by_end_force_;  ///< d states' / d contact force of each stage [1/N]
  LinearForm middle_slip_, middle_x_, end_slip_, end_x_;
  /// Slip velocity removed by a newton in the same stage.
  double middle_compliance_ = 0.0, end_compliance_ = 0.0;
  double middle_force_on_end_slip_ = 0.0;
  /// Response of the load's chain to its input at the beginning and at the end of a period.
  Vector by_load_before_, by_load_after_;

  // Positions in the transition.
  std::vector<int> columns_;  ///< core states that the contact depends on
  std::array<int, max_shared_sums> shared_position_{};
  int theta_position_ = 0;
  /// Entries of a row that depend on lambda.
  struct DriveTerms {
    int row = 0;
    int rate = 0, acceleration = 0, lambda = 0;
  };
  std::vector<DriveTerms> drive_terms_;
  struct Span {
    int first = 0;
    int last = 0;
  };
  std::vector<Span> linear_part_;  ///< by row

  SolvedContact contact_;  ///< of this period
  double last_slip_ = 0.0;
  double gamma_ = 0.0;  ///< in this period
};

}  // namespace stickslip::observer
