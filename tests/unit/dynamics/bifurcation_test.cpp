// SPDX-License-Identifier: Apache-2.0
#include "tools/dynamics/bifurcation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

namespace stickslip::dynamics {
namespace {

physics::Model rubbing() {
  physics::Model model;
  model.oscillator.mass_kg = {1.0};
  model.oscillator.stiffness_n_m = physics::Parameter{1.0};
  model.oscillator.damping_n_s_m = physics::Parameter{0.1};
  model.friction.law = physics::FrictionLaw::coulomb;
  model.friction.mu = {0.5};
  model.friction.transition_speed_m_s = {0.02};
  return model;
}

BifurcationOptions quick(int threads) {
  BifurcationOptions options;
  options.portrait.transient = 5;
  options.portrait.periods = 4;
  options.portrait.steps_per_period = 100;
  options.threads = threads;
  return options;
}

TEST(Bifurcation, DoesNotDependOnTheNumberOfThreads) {
  const std::vector<double> values = {0.2, 0.4, 0.6, 0.8, 1.0};
  const auto one = bifurcation(rubbing(), {1.0, 1.2, 0.0}, "friction.mu", values, quick(1));
  const auto three = bifurcation(rubbing(), {1.0, 1.2, 0.0}, "friction.mu", values, quick(3));
  ASSERT_EQ(one.size(), values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    EXPECT_EQ(one[i].value, values[i]);
    ASSERT_EQ(one[i].section.size(), 4U);
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_EQ(one[i].section[k].x(), three[i].section[k].x());
    }
  }
}

TEST(Bifurcation, OverTheDriveChangesTheDrive) {
  const auto columns =
      bifurcation(rubbing(), {1.0, 1.2, 0.0}, "drive.acceleration_m_s2", {0.1, 2.0}, quick(1));
  // Below the friction limit only the creep of the smooth law remains.
  EXPECT_LT(std::abs(columns[0].section[3].x()), 0.1);
  EXPECT_GT(std::abs(columns[1].section[3].x()), 0.3);
  const auto by_amplitude =
      bifurcation(rubbing(), {0.0, 2.0, 0.0}, "drive.amplitude_m", {0.5}, quick(1));
  const auto by_acceleration =
      bifurcation(rubbing(), {0.0, 2.0, 0.0}, "drive.acceleration_m_s2", {2.0}, quick(1));
  EXPECT_EQ(by_amplitude[0].section[3].x(), by_acceleration[0].section[3].x());
  const auto by_frequency =
      bifurcation(rubbing(), {1.0, 1.2, 0.0}, "drive.frequency_hz", {0.5}, quick(1));
  EXPECT_NEAR(by_frequency[0].section[0].time_s, 5.0 / 0.5, 1.0e-9);
}

TEST(Bifurcation, OverTheFrequencyKeepsTheBaseAmplitudeOnRequest) {
  BifurcationOptions options = quick(1);
  const Drive drive{9.0, 1.2, 0.0};
  const double omega = 2.0 * std::numbers::pi * 0.3;
  const auto acceleration_kept =
      bifurcation(rubbing(), drive, "drive.frequency_hz", {0.3}, options);
  EXPECT_EQ(acceleration_kept[0].section[3].x(),
            poincare_section(rubbing(), {9.0, omega, 0.0}, options.portrait)[3].x());
  options.base_amplitude_m = 0.7;
  const auto amplitude_kept = bifurcation(rubbing(), drive, "drive.frequency_hz", {0.3}, options);
  EXPECT_EQ(
      amplitude_kept[0].section[3].x(),
      poincare_section(rubbing(), {0.7 * omega * omega, omega, 0.0}, options.portrait)[3].x());
}

TEST(Bifurcation, RefusesValuesThatAParameterCannotHave) {
  const auto model = rubbing();
  EXPECT_EQ(refusal(model, "friction.mu", 0.5), "");
  EXPECT_NE(refusal(model, "friction.mu", -0.5), "");
  EXPECT_NE(refusal(model, "drive.frequency_hz", 0.0), "");
  EXPECT_NE(refusal(model, "drive.acceleration_m_s2", std::nan("")), "");
  EXPECT_THROW(bifurcation(model, {1.0, 1.2, 0.0}, "drive.frequency_hz", {0.0}, quick(1)),
               std::invalid_argument);
}

TEST(Bifurcation, ListsItsParameters) {
  const auto paths = bifurcation_paths(rubbing());
  EXPECT_THAT(paths, ::testing::Contains("drive.acceleration_m_s2"));
  EXPECT_THAT(paths, ::testing::Contains("friction.mu"));
  EXPECT_THROW(bifurcation(rubbing(), {1.0, 1.2, 0.0}, "friction.nu", {1.0}, quick(1)),
               std::invalid_argument);
  EXPECT_THROW(bifurcation(rubbing(), {1.0, 1.2, 0.0}, "oscillator.mass_kg", {-1.0}, quick(1)),
               std::invalid_argument);
}

}  // namespace
}  // namespace stickslip::dynamics
