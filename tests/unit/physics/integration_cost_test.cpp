// SPDX-License-Identifier: Apache-2.0
// Integrations that would not end are refused with the parameter at fault.
#include "physics/integration_cost.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numbers>

namespace stickslip::physics {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

Model oscillator() {
  Model model;
  model.oscillator.excitation = Excitation::base;
  model.oscillator.mass_kg = {2.0};
  model.oscillator.natural_frequency_hz = Parameter{1.0};
  model.oscillator.damping_ratio = Parameter{0.1};
  return model;
}

TEST(FastestMotion, IsThatOfTheParameterThatSetsIt) {
  Model model = oscillator();
  EXPECT_EQ(fastest_motion(model).parameter, "oscillator.natural_frequency_hz");
  EXPECT_DOUBLE_EQ(fastest_motion(model).rate_rad_s, 2.0 * std::numbers::pi);
  model.oscillator.damping_ratio.reset();
  model.oscillator.damping_n_s_m = Parameter{1.0e6};
  EXPECT_EQ(fastest_motion(model).parameter, "oscillator.damping_n_s_m");
  EXPECT_DOUBLE_EQ(fastest_motion(model).rate_rad_s, 0.5e6);
  model = oscillator();
  model.oscillator.natural_frequency_hz.reset();
  model.oscillator.stiffness_n_m = Parameter{8.0};
  EXPECT_EQ(fastest_motion(model).parameter, "oscillator.stiffness_n_m");
  EXPECT_DOUBLE_EQ(fastest_motion(model).rate_rad_s, 2.0);
  model.load_cell = LoadCell{{0.01}, {20.0}, {0.02}, LoadCellDynamics::resonant};
  model.friction.law = FrictionLaw::coulomb;
  model.friction.mu = {0.1};
  EXPECT_EQ(fastest_motion(model).parameter, "load_cell.natural_frequency_hz");
}

TEST(FastestMotion, IsNoneIfTheMotionIsImposed) {
  Model model;
  model.oscillator.excitation = Excitation::imposed;
  model.friction.law = FrictionLaw::coulomb;
  model.friction.mu = {0.5};
  EXPECT_EQ(fastest_motion(model).rate_rad_s, 0.0);
  EXPECT_THAT(wrong_with_simulation(model, 3600.0), IsEmpty());
}

TEST(IntegrationCost, IsRefusedWithTheStepsAndTheParameter) {
  Model model = oscillator();
  EXPECT_THAT(wrong_with_steps(model, most_steps, "2 drive periods"), IsEmpty());
  EXPECT_EQ(wrong_with_steps(model, 3.0e9, "2 drive periods"),
            "3e+09 integration steps for 2 drive periods, expected at most 1e+09: "
            "oscillator.natural_frequency_hz = 1 lets the model move at 6.28 rad/s. Is its unit "
            "right?");
  EXPECT_THAT(wrong_with_steps(model, std::numeric_limits<double>::quiet_NaN(), "1 s"),
              HasSubstr("integration steps for 1 s"));
}

TEST(IntegrationCost, OfASimulationIsBounded) {
  Model model = oscillator();
  EXPECT_THAT(wrong_with_simulation(model, 86400.0), IsEmpty());
  EXPECT_THAT(wrong_with_simulation(model, 1.0e7), HasSubstr("expected at most 1e+09"));
  model.oscillator.natural_frequency_hz = Parameter{1.0e6};
  EXPECT_THAT(wrong_with_simulation(model, 0.01),
              testing::AllOf(HasSubstr("the shortest"),
                             HasSubstr("oscillator.natural_frequency_hz = 1e+06")));
}

}  // namespace
}  // namespace stickslip::physics
