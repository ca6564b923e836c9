// SPDX-License-Identifier: Apache-2.0
#include "physics/integration_cost.h"

#include <cmath>
#include <numbers>
#include <optional>

#include "physics/number_text.h"
#include "physics/rig.h"

namespace stickslip::physics {

namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

std::string culprit(const Model& model) {
  const FastestMotion fastest = fastest_motion(model);
  if (fastest.parameter.empty()) return "";
  return fastest.parameter + " = " + number_text(fastest.value) + " lets the model move at " +
         number_text(fastest.rate_rad_s) + " rad/s. Is its unit right?";
}

}  // namespace

FastestMotion fastest_motion(const Model& model) {
  const Rig rig(model);
  const auto c = rig.numbers<double>(rig.parameter_values()).c;
  FastestMotion out;
  const auto consider = [&out](double rate, const char* path, const std::optional<Parameter>& set) {
    if (!set || !(rate > out.rate_rad_s)) return;
    out = {rate, path, set->value};
  };
  const Oscillator& oscillator = model.oscillator;
  if (oscillator.excitation == Excitation::imposed) return out;
  if (oscillator.two_well) {
    consider(std::sqrt(2.0 * c.well_linear / c.mass), "oscillator.two_well.linear_n_m",
             oscillator.two_well->linear_n_m);
  } else {
    const double rate = std::sqrt(c.stiffness / c.mass);
    consider(rate, "oscillator.natural_frequency_hz", oscillator.natural_frequency_hz);
    consider(rate, "oscillator.stiffness_n_m", oscillator.stiffness_n_m);
  }
  const double decay = c.damping / c.mass;
  consider(decay, "oscillator.damping_ratio", oscillator.damping_ratio);
  consider(decay, "oscillator.damping_n_s_m", oscillator.damping_n_s_m);
  if (rig.structure().resonant && model.load_cell) {
    consider(two_pi * model.load_cell->natural_frequency_hz.value, "load_cell.natural_frequency_hz",
             model.load_cell->natural_frequency_hz);
  }
  return out;
}

std::string wrong_with_steps(const Model& model, double steps, const std::string& integrated,
                             double most) {
  if (steps <= most) return {};
  return number_text(steps) + " integration steps for " + integrated + ", expected at most " +
         number_text(most) + ": " + culprit(model);
}

std::string wrong_with_simulation(const Model& model, double duration_s) {
  const Rig rig(model);
  // Explicit steps are stable up to about 2.8 divided by the rate.
  if (fastest_motion(model).rate_rad_s * rig.longest_step_s() > 1.0) {
    return "steps of " + number_text(rig.longest_step_s()) +
           " s, the shortest ones, are too long: " + culprit(model);
  }
  return wrong_with_steps(model, duration_s / rig.longest_step_s(), number_text(duration_s) + " s");
}

}  // namespace stickslip::physics
