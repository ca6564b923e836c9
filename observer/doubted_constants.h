// What constants that the model doubts, but that are no states of the filter, do to its estimate:
// mass, spring and damping of the oscillator. The filter counts their doubt as noise, which
// averages out; a wrong constant does not. How far a constant that is off by one sigma leads the
// estimate astray is followed beside the filter, through its own transitions and gains (the
// consider filter of S. F. Schmidt for a gain that is given), and is added to the doubt that is
// told. The estimate itself is not touched.
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

class DoubtedConstants {
 public:
  /// `rig` and `layout` must outlive it.
  DoubtedConstants(physics::Model model, const physics::Rig& rig, const Layout& layout,
                   double period_s);

  /// Whether the model doubts any.
  bool any() const { return !push_.empty(); }

  /// The estimate begins anew, from readings alone.
  void forget();

  /// A period begins in which the constants push the mass; `mean` is the estimate then.
  void push(const Vector& mean);
  /// The period has passed.
  void propagate(const Transition& transition);
  /// A reading was used with this gain.
  void correct(const Sight& sight, const Covariance::States& gain);

  /// What they add to the covariance of these states, in their order; the rest stays as it is.
  void covariance_of(std::span<const int> states,
                     std::array<std::array<double, quantity_count>, quantity_count>& out) const;
  /// What they add to the variance of the slip velocity [(m/s)^2].
  double slip_variance() const;

 private:
  /// By how much one sigma changes the mass' acceleration, per unit of what it is multiplied by.
  struct Push {
    double by_x = 0.0, by_x_cubed = 0.0, by_v = 0.0;
    double by_force = 0.0;  ///< friction and the drive; those of [[physics]] terms are left out
  };
  static constexpr int lanes = 4;
  /// One value for each of four constants: what a state is off by if that constant is by one sigma.
  using Off = Eigen::Array<double, lanes, 1>;
  using Group = std::array<Off, static_cast<std::size_t>(padded(max_states) + max_shared_sums)>;

  void move(Group& group, const Transition& transition);

  const physics::Structure* structure_;
  const Layout* layout_;
  double period_s_;
  std::vector<Push> push_;
  std::vector<Group> group_;  ///< constants by fours
  Group next_;
};

}  // namespace stickslip::observer
