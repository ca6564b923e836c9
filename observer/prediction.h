// SPDX-License-Identifier: Apache-2.0
// Time update of the filter's mean over one period, with its Jacobian.
#pragma once

#include <memory>
#include <vector>

#include "observer/layout.h"
#include "observer/parameter_response.h"
#include "observer/sensor_error_states.h"
#include "observer/transition.h"
#include "physics/rig.h"

namespace stickslip::observer {

/// The rig's input for the drive's p, p' and p'' and a measured load [N].
physics::Input input_of(physics::Excitation excitation, double p, double rate, double acceleration,
                        double load_n);

class Prediction {
 public:
  virtual ~Prediction() = default;
  Prediction(const Prediction&) = delete;
  Prediction& operator=(const Prediction&) = delete;

  /// Propagates `mean` by one period from `time_s` and updates transition(). The backbone g is
  /// replaced by its mean over a Gaussian slip velocity of variance `slip_variance` [(m/s)^2]
  /// (statistical linearisation).
  virtual void advance(Vector& mean, double time_s, double slip_variance) = 0;

  const Transition& transition() const { return transition_; }
  /// Prepares the transition for a covariance with rows of this width.
  void set_row_width(int width) { transition_.set_width(width); }

  /// Effect of these parameters of `model`, the one that is predicted, on the period of the last
  /// advance(). This must outlive it.
  virtual std::unique_ptr<ParameterResponse> response_to(UncertainParameters parameters,
                                                         const physics::Model& model) const;

  /// Transition speed of the mean of g over that distribution of the slip velocity: the mean of
  /// tanh(v / v0) is close to a wider tanh, with exact slope for v0 = 0, where it is erf. So the
  /// set-valued law is differentiable too.
  double widened_transition_speed(double slip_variance) const;

  /// Coefficients of the model's equations.
  const physics::RigNumbers<double>& numbers() const { return numbers_; }

 protected:
  Prediction(const physics::Rig& rig, const Layout& layout, double period_s);

  const physics::Rig* rig_;
  const Layout* layout_;
  double period_s_;
  bool loaded_by_measurement_;
  SensorErrorStates sensor_error_states_;
  physics::RigNumbers<double> numbers_;
  physics::RigNumbers<physics::Dual> dual_numbers_;
  Transition transition_;
  Vector next_;  ///< states at the end of the period
};

/// Decay time of p' and p'' of the drive, so that the estimate of an unmeasured drive stays
/// bounded.
inline constexpr double drive_memory_s = 20.0;
inline constexpr double load_rate_memory_s = 1.0;

/// ContactPrediction where it supports the rig, otherwise DualPrediction. `rig` and `layout` must
/// outlive it. `steps`: integration steps in a period.
std::unique_ptr<Prediction> make_prediction(const physics::Rig& rig, const physics::Model& model,
                                            const Layout& layout, double period_s, int steps);

}  // namespace stickslip::observer
