// SPDX-License-Identifier: Apache-2.0
#include "tools/dynamics/lyapunov.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace stickslip::dynamics {
namespace {

physics::Model duffing_without_friction(double damping) {
  physics::Model model;
  model.oscillator.mass_kg = {1.0};
  model.oscillator.damping_n_s_m = physics::Parameter{damping};
  model.oscillator.stiffness_n_m = physics::Parameter{1.0};
  return model;
}

// x'' + 2 d x' + x: everything shrinks as exp(-d t).
TEST(Lyapunov, ExponentOfALinearOscillatorIsItsDamping) {
  for (const double d : {0.05, 0.2}) {
    LyapunovOptions options;
    options.periods = 100;
    options.transient = 20;
    const Lyapunov found =
        largest_exponent(duffing_without_friction(2.0 * d), {0.5, 1.3, 0.0}, options);
    EXPECT_NEAR(found.exponent_per_s, -d, 0.01 * d + 3.0 * found.standard_error_per_s);
    EXPECT_NEAR(found.per_period, found.exponent_per_s * 2.0 * std::numbers::pi / 1.3, 1.0e-12);
  }
}

// Eqs. (5) and (6) of the paper with the parameters of its Figure 10: 0.101 per unit time over 4000
// periods. A quarter of that here, with its standard error.
TEST(Lyapunov, OfThePapersMotivationalOscillatorIsPositive) {
  physics::Model model = duffing_without_friction(0.0);
  model.normal_load = physics::NormalLoad{physics::NormalLoadLaw::wedge, {1.0}, {1.5}};
  model.friction.law = physics::FrictionLaw::state_variable;
  model.friction.mu = {1.0};
  model.friction.transition_speed_m_s = {0.02};
  model.friction.rate_per_s = {10.0};
  LyapunovOptions options;
  options.periods = 1000;
  options.x_m = 0.5;
  const Lyapunov found = largest_exponent(model, {1.9, 1.25, 0.0}, options);
  EXPECT_LT(found.standard_error_per_s, 0.006);
  EXPECT_NEAR(found.exponent_per_s, 0.1012, 4.0 * found.standard_error_per_s);
  EXPECT_NEAR(found.per_period, 0.51, 4.0 * found.standard_error_per_s * 5.03);
}

TEST(Lyapunov, NeedsTwentyPeriods) {
  LyapunovOptions options;
  options.periods = 19;
  EXPECT_THROW(largest_exponent(duffing_without_friction(0.1), {0.5, 1.3, 0.0}, options),
               std::invalid_argument);
}

}  // namespace
}  // namespace stickslip::dynamics
