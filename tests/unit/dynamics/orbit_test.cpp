// SPDX-License-Identifier: Apache-2.0
#include "tools/dynamics/orbit.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "physics/problem.h"

namespace stickslip::dynamics {
namespace {

physics::Model oscillator(physics::Excitation excitation) {
  physics::Model model;
  model.oscillator.excitation = excitation;
  model.oscillator.mass_kg = {2.0};
  model.oscillator.natural_frequency_hz = physics::Parameter{1.0};
  model.oscillator.damping_ratio = physics::Parameter{0.1};
  return model;
}

// The closed form of a driven linear oscillator, in its steady state.
TEST(Orbit, MatchesTheSteadyResponseOfALinearRig) {
  for (const auto excitation : {physics::Excitation::base, physics::Excitation::force}) {
    const Drive drive = base_drive(0.01, 1.3);
    Orbit orbit(oscillator(excitation), drive, 2000);
    orbit.skip(60);
    const double w0 = 2.0 * std::numbers::pi;
    const double w = drive.omega_rad_s;
    const double in_phase = w0 * w0 - w * w;
    const double quadrature = 2.0 * 0.1 * w0 * w;
    const double gain = drive.acceleration_m_s2 / (in_phase * in_phase + quadrature * quadrature);
    EXPECT_NEAR(orbit.now().x(), gain * in_phase, 2.0e-5 * gain * w0 * w0);
    EXPECT_NEAR(orbit.now().v(), gain * quadrature * w, 2.0e-4 * gain * w0 * w0);
  }
}

TEST(Orbit, MeetsEveryPeriodExactly) {
  Orbit orbit(oscillator(physics::Excitation::base), base_drive(0.01, 3.0), 500);
  orbit.skip(7);
  EXPECT_DOUBLE_EQ(orbit.now().time_s, 7.0 / 3.0);
}

TEST(Orbit, BaseDriveIsTheAccelerationOfTheBase) {
  const Drive drive = base_drive(0.008, 2.5);
  const double w = 2.0 * std::numbers::pi * 2.5;
  EXPECT_DOUBLE_EQ(drive.acceleration_m_s2, 0.008 * w * w);
  EXPECT_DOUBLE_EQ(drive.period_s(), 0.4);
}

TEST(Orbit, RefusesUnsupportedModels) {
  physics::Model imposed;
  imposed.oscillator.excitation = physics::Excitation::imposed;
  imposed.friction.law = physics::FrictionLaw::coulomb;
  imposed.friction.mu = {0.5};
  EXPECT_THROW(Orbit(imposed, base_drive(0.01, 1.0), 500), std::invalid_argument);
  EXPECT_THROW(Orbit(oscillator(physics::Excitation::base), base_drive(0.01, 1.0), 10),
               std::invalid_argument);
}

TEST(EnoughSteps, ResolveTheLoadCell) {
  auto model = oscillator(physics::Excitation::base);
  model.friction.law = physics::FrictionLaw::coulomb;
  model.friction.mu = {0.1};
  EXPECT_EQ(enough_steps(model, base_drive(0.01, 1.0)), 500);
  model.load_cell = physics::LoadCell{{0.01}, {20.0}, {0.02}, physics::LoadCellDynamics::resonant};
  EXPECT_GT(enough_steps(model, base_drive(0.01, 1.0)), 6000);
}

TEST(EnoughSteps, AreNotMoreThanAnyoneWaitsFor) {
  auto model = oscillator(physics::Excitation::base);
  model.oscillator.natural_frequency_hz = physics::Parameter{1.0e3};
  const Drive drive = base_drive(0.01, 1.0);
  EXPECT_NO_THROW(enough_steps(model, drive, 3000));
  EXPECT_THROW(enough_steps(model, drive, 4000), InputError) << "1.3e9 steps";
  model.oscillator.natural_frequency_hz = physics::Parameter{1.0e4};
  EXPECT_THROW(enough_steps(model, drive), InputError) << "3e6 steps a period";
  model.oscillator.natural_frequency_hz = physics::Parameter{1.0};
  EXPECT_NO_THROW(enough_steps(model, drive, 20'000'000)) << "500 steps a period, as was wanted";
  model.oscillator.damping_ratio = physics::Parameter{1.0e9};
  EXPECT_THROW(enough_steps(model, drive), InputError) << "a decay";
}

}  // namespace
}  // namespace stickslip::dynamics
