// SPDX-License-Identifier: Apache-2.0
#include "observer/prediction.h"

#include <cmath>
#include <numbers>
#include <utility>

#include "observer/contact_prediction.h"
#include "observer/dual_prediction.h"

namespace stickslip::observer {

physics::Input input_of(physics::Excitation excitation, double p, double rate, double acceleration,
                        double load_n) {
  physics::Input input;
  switch (excitation) {
    case physics::Excitation::base:
      input.base_displacement_m = p;
      input.base_acceleration_m_s2 = acceleration;
      break;
    case physics::Excitation::force:
      input.drive_force_n = p;
      break;
    case physics::Excitation::imposed:
      input.displacement_m = p;
      input.velocity_m_s = rate;
      break;
  }
  input.normal_load_n = load_n;
  return input;
}

Prediction::Prediction(const physics::Rig& rig, const Layout& layout, double period_s)
    : rig_(&rig),
      layout_(&layout),
      period_s_(period_s),
      loaded_by_measurement_(rig.structure().loaded &&
                             rig.structure().load_law == physics::NormalLoadLaw::measured),
      sensor_error_states_(layout, period_s),
      numbers_(rig.numbers<double>(std::span<const double>(rig.parameter_values()))),
      transition_(layout.count),
      next_(Vector::Zero(layout.count)) {
  const std::vector<double>& values = rig.parameter_values();
  const std::vector<physics::Dual> dual_values(values.begin(), values.end());
  dual_numbers_ = rig.numbers<physics::Dual>(std::span<const physics::Dual>(dual_values));
}

std::unique_ptr<ParameterResponse> Prediction::response_to(UncertainParameters parameters,
                                                           const physics::Model& model) const {
  return std::make_unique<IntegratedResponse>(std::move(parameters), model, *rig_, *layout_,
                                              period_s_);
}

double Prediction::widened_transition_speed(double slip_variance) const {
  const double own = numbers_.c.transition_speed;
  const double spread = 0.5 * std::numbers::pi * std::max(slip_variance, 0.0);
  return std::sqrt(own * own + spread + 1.0e-14);
}

std::unique_ptr<Prediction> make_prediction(const physics::Rig& rig, const physics::Model& model,
                                            const Layout& layout, double period_s, int steps) {
  if (ContactPrediction::supports(rig, model)) {
    return std::make_unique<ContactPrediction>(rig, model, layout, period_s);
  }
  return std::make_unique<DualPrediction>(rig, model, layout, period_s, steps);
}

}  // namespace stickslip::observer
