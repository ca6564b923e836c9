// One period of the filter's model: where its states go, and the derivatives of that.
#pragma once

#include <memory>
#include <vector>

#include "observer/layout.h"
#include "observer/reading_states.h"
#include "observer/transition.h"
#include "physics/rig.h"

namespace stickslip::observer {

class Prediction {
 public:
  virtual ~Prediction() = default;
  Prediction(const Prediction&) = delete;
  Prediction& operator=(const Prediction&) = delete;

  /// Moves `mean` on by one period from `time_s` and renews transition(). The backbone g is taken
  /// as its mean over a Gaussian doubt of the slip velocity of `slip_variance` [(m/s)^2].
  virtual void advance(Vector& mean, double time_s, double slip_variance) = 0;

  const Transition& transition() const { return transition_; }

  /// The plain numbers of the model's equations.
  const physics::RigNumbers<double>& numbers() const { return numbers_; }

 protected:
  Prediction(const physics::Rig& rig, const Layout& layout, double period_s);

  /// The transition speed of the mean of g over that doubt of the slip velocity: the mean of tanh(v
  /// / v0) is about a wider tanh, exact in slope for v0 = 0, where it is erf. So the set-valued law
  /// has derivatives too.
  double widened_transition_speed(double slip_variance) const;

  const physics::Rig* rig_;
  const Layout* layout_;
  double period_s_;
  bool loaded_by_measurement_;
  ReadingStates reading_states_;
  physics::RigNumbers<double> numbers_;
  physics::RigNumbers<physics::Dual> dual_numbers_;
  Transition transition_;
  Vector next_;  ///< the states that advance() arrives at
};

/// p' and p'' of the drive are forgotten over this time, so that a drive that nobody measures
/// cannot run away.
inline constexpr double drive_memory_s = 20.0;
inline constexpr double load_rate_memory_s = 1.0;

/// How to predict this rig: ContactPrediction where it serves, otherwise DualPrediction. `rig` and
/// `layout` must outlive it. `steps`: integration steps in a period.
std::unique_ptr<Prediction> prediction_for(const physics::Rig& rig, const physics::Model& model,
                                           const Layout& layout, double period_s, int steps);

}  // namespace stickslip::observer
