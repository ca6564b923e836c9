// SPDX-License-Identifier: Apache-2.0
#include "tools/dynamics/flow.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "physics/problem.h"

namespace stickslip::dynamics {
namespace {

physics::Model paper(double slope) {
  physics::Model model;
  model.oscillator.mass_kg = {1.0};
  model.oscillator.stiffness_n_m = physics::Parameter{1.0};
  model.oscillator.damping_n_s_m = physics::Parameter{0.0};
  model.normal_load = physics::NormalLoad{physics::NormalLoadLaw::wedge, {1.0}, {slope}};
  model.friction.law = physics::FrictionLaw::state_variable;
  model.friction.mu = {1.0};
  model.friction.transition_speed_m_s = {0.02};
  model.friction.rate_per_s = {10.0};
  return model;
}

physics::Model bench() {
  physics::Model model;
  model.oscillator.mass_kg = {0.06};
  model.oscillator.natural_frequency_hz = physics::Parameter{2.4};
  model.oscillator.damping_ratio = physics::Parameter{0.015};
  model.normal_load = physics::NormalLoad{physics::NormalLoadLaw::constant, {0.15}, {}};
  model.friction.law = physics::FrictionLaw::coulomb;
  model.friction.mu = {0.4};
  model.friction.transition_speed_m_s = {0.0};
  return model;
}

// The reference states of Eqs. (5) and (6) for the parameters of Figure 10, each to 1e-4.
TEST(Flow, FollowsEquations5And6OfThePaper) {
  Flow flow(paper(1.5), {1.9, 1.25, 0.0}, 1.0e-8, 0.5);
  const double states[][4] = {{1.0, 0.52880, -0.00069, 0.05083},
                              {5.0, -0.07488, 1.25787, 0.99895},
                              {10.0, 0.63404, 0.01585, 0.64759},
                              {20.0, 0.20638, 0.23548, 0.99982}};
  for (const auto& [t, x, v, theta] : states) {
    flow.advance(t);
    EXPECT_NEAR(flow.now().x(), x, 1.0e-4) << t;
    EXPECT_NEAR(flow.now().v(), v, 1.0e-4) << t;
    EXPECT_NEAR(flow.now().state.theta, theta, 1.0e-4) << t;
  }
}

// Eqs. (3) and (4) with the modulated drive of Figure 9.
TEST(Flow, FollowsAModulatedDrive) {
  physics::Model model = paper(0.0);
  model.normal_load.reset();
  Flow flow(model, {2.0, 1.5, 1.5 / 40.0}, 1.0e-8);
  flow.advance(10.0);
  EXPECT_NEAR(flow.now().x(), 1.35637, 1.0e-4);
  EXPECT_NEAR(flow.now().v(), 0.09916, 1.0e-4);
  EXPECT_NEAR(flow.now().state.theta, 1.0, 1.0e-4);
}

struct Case {
  std::string name;
  physics::Model model;
  Drive drive;
};

std::vector<Case> cases() {
  std::vector<Case> out;
  for (const bool resonant : {false, true}) {
    for (const bool memory : {false, true}) {
      for (const std::string load : {"constant", "wedge", "two_well", "forced"}) {
        physics::Model model = bench();
        if (memory) {
          model.friction.law = physics::FrictionLaw::state_variable;
          model.friction.transition_speed_m_s = {0.0025};
          model.friction.rate_per_s = {150.0};
        }
        if (resonant) {
          model.load_cell =
              physics::LoadCell{{0.0126}, {19.3}, {0.016}, physics::LoadCellDynamics::resonant};
        }
        if (load == "wedge") {
          // Loses its contact: beyond -5 mm there is no load.
          model.normal_load = physics::NormalLoad{physics::NormalLoadLaw::wedge, {0.1}, {200.0}};
        }
        if (load == "two_well") {
          model.oscillator.damping_ratio.reset();
          model.oscillator.damping_n_s_m = physics::Parameter{0.02};
          model.oscillator.two_well = physics::TwoWell{{24.0}, {375000.0}};
        }
        if (load == "forced") model.oscillator.excitation = physics::Excitation::force;
        out.push_back({load + (memory ? "_memory" : "_set_valued") + (resonant ? "_resonant" : ""),
                       model, base_drive(0.006, 3.1)});
      }
    }
  }
  return out;
}

class Agreement : public testing::TestWithParam<Case> {};

// Two independent solvers: small steps of the rig, and the flow.
TEST_P(Agreement, WithSmallStepsOfTheRig) {
  const auto& [name, model, drive] = GetParam();
  // The steps resolve the end of contact to one step.
  const bool set_valued = model.friction.law == physics::FrictionLaw::coulomb;
  const int steps = set_valued ? 320000 : 40000;
  Orbit orbit(model, drive, steps, 0.004);
  Flow flow(model, drive, 1.0e-8, 0.004);
  double largest = 0.0;
  int slips = 0;
  for (int part = 1; part <= 60; ++part) {
    for (int k = 0; k < steps / 20; ++k) orbit.step();
    flow.advance(orbit.now().time_s);
    largest = std::max(largest, std::abs(orbit.now().x()));
    if (flow.now().state.slip != 0.0) ++slips;
    ASSERT_NEAR(flow.now().x(), orbit.now().x(), 1.0e-5 * largest) << "part " << part;
    ASSERT_NEAR(flow.now().v(), orbit.now().v(), 1.0e-3 * 19.0 * largest) << "part " << part;
    ASSERT_NEAR(flow.now().state.load, orbit.now().state.load, 1.0e-5);
  }
  EXPECT_GT(slips, 5);
}

INSTANTIATE_TEST_SUITE_P(Rigs, Agreement, testing::ValuesIn(cases()),
                         [](const auto& info) { return info.param.name; });

// Without a drive the system of section 7 loses 4 mu N / k of its amplitude per cycle, and then
// stays at rest exactly.
TEST(Flow, CoulombFreeDecayLosesFourMuNOverKPerCycleAndThenRests) {
  physics::Model model = bench();
  model.oscillator.damping_ratio = physics::Parameter{0.0};
  const double k = 0.06 * std::pow(2.0 * M_PI * 2.4, 2);
  const double loss = 4.0 * 0.4 * 0.15 / k;
  const double start = 2.3 * loss;
  Flow flow(model, base_drive(0.0, 2.4), 1.0e-9, start);
  flow.advance(1.0 / 2.4);
  EXPECT_NEAR(flow.now().x(), start - loss, 1.0e-7 * loss);
  flow.advance(2.0 / 2.4);
  EXPECT_NEAR(flow.now().x(), start - 2.0 * loss, 1.0e-7 * loss);
  flow.advance(3.0);
  const double rest = flow.now().x();
  EXPECT_EQ(flow.now().state.slip, 0.0);
  EXPECT_LE(std::abs(k * rest), 0.4 * 0.15);
  flow.advance(30.0);
  EXPECT_EQ(flow.now().x(), rest);
  EXPECT_EQ(flow.now().v(), 0.0);
}

TEST(Flow, DoesNotDependOnTheOutputTimes) {
  Flow once(paper(1.5), {1.9, 1.25, 0.0}, 1.0e-7, 0.5);
  Flow often(paper(1.5), {1.9, 1.25, 0.0}, 1.0e-7, 0.5);
  once.advance(40.0);
  for (int i = 1; i <= 4000; ++i) often.advance(0.01 * i);
  EXPECT_EQ(often.now().x(), once.now().x());
  once.start(0.5, 0.0);
  once.advance(40.0);
  EXPECT_EQ(often.now().x(), once.now().x());
}

TEST(Flow, EndsIfItsStepsBecomeTooShort) {
  physics::Model model = bench();
  model.oscillator.natural_frequency_hz.reset();
  model.oscillator.damping_ratio.reset();
  model.oscillator.stiffness_n_m = physics::Parameter{0.0};
  model.oscillator.damping_n_s_m = physics::Parameter{0.0};
  model.oscillator.two_well = physics::TwoWell{{1.0}, {1.0e18}};
  Flow flow(model, base_drive(0.001, 3.0), 1.0e-7, 0.1);
  EXPECT_THROW(flow.advance(10.0), InputError);
}

TEST(Flow, RefusesUnsupportedModels) {
  physics::Model model = bench();
  EXPECT_TRUE(Flow::can_follow(model));
  model.friction.transition_speed_m_s = {0.001};  // smooth, without memory
  EXPECT_FALSE(Flow::can_follow(model));
  EXPECT_THROW(Flow(model, base_drive(0.001, 3.0)), std::invalid_argument);
  model = paper(1.5);
  EXPECT_TRUE(Flow::can_follow(model));
  model.friction.rate_per_s = {1.0e5};  // all but Coulomb: left to the implicit contact
  EXPECT_FALSE(Flow::can_follow(model));
  model = bench();
  model.terms.push_back({"cubic_stiffness", {}, {{"k3_n_m3", {100.0}}}});
  EXPECT_FALSE(Flow::can_follow(model));
}

}  // namespace
}  // namespace stickslip::dynamics
