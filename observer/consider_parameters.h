// Consider parameters (Schmidt-Kalman filter): mass, spring and damping of the oscillator where the
// model gives them a standard deviation. They are not states of the filter. As process noise their
// uncertainty would average out, but the error of a constant does not. The sensitivity of the
// estimate to an error of one standard deviation is propagated through the filter's own transitions
// and gains, and added to the covariance that is reported. The estimate itself does not change.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "observer/covariance.h"
#include "observer/layout.h"
#include "observer/observer.h"
#include "observer/transition.h"
#include "physics/model.h"
#include "physics/rig.h"

namespace stickslip::observer {

class ConsiderParameters {
 public:
  /// `rig` and `layout` must outlive it.
  ConsiderParameters(physics::Model model, const physics::Rig& rig, const Layout& layout,
                     double period_s);

  /// True if the model has any.
  bool any() const { return !input_.empty(); }

  /// Zero sensitivity: the filter has been reinitialised from readings alone.
  void reset();

  /// Input of the parameters over the period that begins; `mean` is the estimate at its beginning.
  void add_input(const Vector& mean);
  /// Time update, after add_input().
  void propagate(const Transition& transition);
  /// Measurement update with this row and gain.
  void correct(const MeasurementRow& row, const Covariance::States& gain);

  /// Contribution to the covariance of these states, in their order; other elements of `out` are
  /// not changed.
  void covariance_of(std::span<const int> states,
                     std::array<std::array<double, quantity_count>, quantity_count>& out) const;
  /// Contribution to the variance of the slip velocity [(m/s)^2].
  double slip_variance() const;

 private:
  /// Change of the mass's acceleration by one standard deviation, per unit of each factor.
  struct Input {
    double by_x = 0.0, by_x_cubed = 0.0, by_v = 0.0;
    double by_force = 0.0;  ///< friction and drive, without the forces of [[physics]] terms
  };
  static constexpr int lanes = 4;
  /// One value for each of four parameters: error of a state for a parameter error of one standard
  /// deviation.
  using Lanes = Eigen::Array<double, lanes, 1>;
  using Group = std::array<Lanes, static_cast<std::size_t>(padded(max_states) + max_shared_sums)>;

  void propagate(Group& group, const Transition& transition);

  const physics::Structure* structure_;
  const Layout* layout_;
  double period_s_;
  std::vector<Input> input_;
  std::vector<Group> group_;  ///< sensitivities, parameters in groups of four
  Group next_;
};

}  // namespace stickslip::observer
