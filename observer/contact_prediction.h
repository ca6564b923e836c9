// The prediction of rigs that are linear but for their contact: the paper's. Everything linear, the
// sensor chains included, moves exactly, by weights that are found once by letting the rig's own
// equations run in small steps. What is left for a period is the contact, in the two implicit
// stages of the rig's integrator.
#pragma once

#include <array>
#include <vector>

#include "observer/prediction.h"

namespace stickslip::observer {

class ContactPrediction final : public Prediction {
 public:
  /// Whether it can predict such rigs: a linear spring, the paper's laws of friction (not a
  /// bristle), and no [[physics]] terms.
  static bool serves(const physics::Rig& rig, const physics::Model& model);

  ContactPrediction(const physics::Rig& rig, const physics::Model& model, const Layout& layout,
                    double period_s);

  void advance(Vector& mean, double time_s, double slip_variance) override;

 private:
  /// One value for each core state; whoever makes one writes all of them.
  struct Row {
    alignas(32) std::array<double, max_core> of;
    double& operator[](int i) { return of[static_cast<std::size_t>(i)]; }
    double operator[](int i) const { return of[static_cast<std::size_t>(i)]; }
  };

  /// A linear function of the core, bent by the drive's lambda.
  struct Line {
    Row still = {};                  ///< where lambda is 0
    double bend_rate = 0.0;          ///< of p', for each lambda
    double bend_acceleration = 0.0;  ///< of p''
  };
  /// Something in the contact, and its derivatives.
  struct Sloped {
    double value;
    Row slope;
  };
  /// Normal load, or the reading of its bridge, and its derivatives.
  struct Load {
    double value = 1.0;
    double by_x = 0.0;
    double by_load = 0.0;
    double by_load_rate = 0.0;
  };
  struct Stage {
    Sloped theta;
    Sloped force;
  };

  void find_responses(const physics::Model& model);
  void find_load_chain(const physics::Model& model);
  Vector sizes(double force_n) const;
  void drop_the_negligible();
  void lay_rows();
  void renew_drive(const Vector& mean);
  void add_contact(const Vector& mean, double speed);
  void add_load_chain(const Vector& mean, const Sloped& x_after);

  Row no_slope() const;
  void add(Row& to, double weight, const Row& what) const;
  Sloped follow(const Line& line, const Vector& mean) const;
  Load load_after(double time_s, double x, const Vector& mean);
  Load load_reading(double time_s, double x, const Vector& mean);
  void add_load_slope(Row& to, double weight, const Load& load, const Row& x) const;
  Stage close(const Sloped& free_slip, double give, const Load& load, const Sloped& x,
              const Sloped& from, double speed, const Vector& mean);
  void put(int place, const Row& slope);

  bool load_varies_;  ///< with x
  int core_;
  physics::RigState<physics::Dual> dual_state_;

  // Found once.
  Matrix still_;                          ///< d states' / d states without contact, lambda = 0
  Vector bend_rate_, bend_acceleration_;  ///< what lambda p' and lambda p'' add to the states
  Vector early_, late_;  ///< what a newton in the contact's first and last stage adds
  Line middle_slip_, middle_x_, end_slip_, end_x_;
  double middle_give_ = 0.0, end_give_ = 0.0;  ///< slip that a newton takes away in its own stage
  double early_on_end_slip_ = 0.0;
  Vector load_before_, load_after_;  ///< of the load's chain, of its input at both ends

  // Where in the transition things stand.
  std::vector<int> columns_;  ///< of the core that the contact depends on
  std::array<int, max_shared_sums> shared_place_{};
  int theta_place_ = 0;
  struct Bent {
    int row = 0;
    int rate = 0, acceleration = 0, lambda = 0;
  };
  std::vector<Bent> bent_;
  struct Span {
    int first = 0;
    int last = 0;
  };
  std::vector<Span> linear_;

  double last_slip_ = 0.0;
  double rate_ = 0.0;  ///< gamma in this period
};

}  // namespace stickslip::observer
