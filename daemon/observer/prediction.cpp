#include "daemon/observer/prediction.h"

#include <cmath>
#include <numbers>

#include "daemon/observer/contact_prediction.h"
#include "daemon/observer/dual_prediction.h"

namespace stickslip::observer {

Prediction::Prediction(const physics::Rig& rig, const Layout& layout)
    : numbers_(rig.numbers<double>(std::span<const double>(rig.parameter_values()))),
      transition_(layout.count) {}

double Prediction::widened_transition_speed(double slip_variance) const {
  const double own = numbers_.c.transition_speed;
  const double doubtful = 0.5 * std::numbers::pi * std::max(slip_variance, 0.0);
  return std::sqrt(own * own + doubtful + 1.0e-14);
}

std::unique_ptr<Prediction> prediction_for(const physics::Rig& rig, const physics::Model& model,
                                           const Layout& layout, double period_s, int steps) {
  if (ContactPrediction::serves(rig, model)) {
    return std::make_unique<ContactPrediction>(rig, model, layout, period_s);
  }
  return std::make_unique<DualPrediction>(rig, model, layout, period_s, steps);
}

}  // namespace stickslip::observer
