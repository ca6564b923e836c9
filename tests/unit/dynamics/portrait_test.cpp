// SPDX-License-Identifier: Apache-2.0
#include "tools/dynamics/portrait.h"

#include <gtest/gtest.h>

namespace stickslip::dynamics {
namespace {

constexpr Drive figure_9{2.0, 1.5, 1.5 / 40.0};
constexpr Drive figure_10{1.9, 1.25, 0.0};

// Eqs. (3) to (6) of the paper, with unit parameters.
physics::Model paper(bool wedge, bool memory) {
  physics::Model model;
  model.oscillator.mass_kg = {1.0};
  model.oscillator.stiffness_n_m = physics::Parameter{1.0};
  model.oscillator.damping_n_s_m = physics::Parameter{0.0};
  if (wedge) {
    model.normal_load = physics::NormalLoad{physics::NormalLoadLaw::wedge, {1.0}, {1.5}};
  }
  model.friction.mu = {1.0};
  if (memory) {
    model.friction.law = physics::FrictionLaw::state_variable;
    model.friction.transition_speed_m_s = {0.02};
    model.friction.rate_per_s = {10.0};
  } else {
    model.friction.law = physics::FrictionLaw::coulomb;
    model.friction.transition_speed_m_s = {0.0};  // set-valued
  }
  return model;
}

TEST(Portrait, Figure10HasTheRangesAndSharesOfALongRun) {
  PortraitOptions options;
  options.x_m = 0.5;
  options.periods = 2000;
  const Portrait seen = portrait(paper(true, true), figure_10, options);
  EXPECT_NEAR(seen.displacement_m.low, -1.02, 0.01);
  EXPECT_NEAR(seen.displacement_m.high, 1.43, 0.01);
  EXPECT_NEAR(seen.velocity_m_s.low, -0.93, 0.01);
  EXPECT_NEAR(seen.velocity_m_s.high, 2.08, 0.01);
  EXPECT_NEAR(seen.contact_lost, 0.035, 0.004);
  EXPECT_NEAR(seen.negative_friction, 0.047, 0.004);
  EXPECT_EQ(seen.normal_load_n.low, 0.0);
}

TEST(Portrait, OfFigure9HasTheExtremesOfOneModulationPeriod) {
  PortraitOptions options;
  options.transient = 0;
  options.periods = 40;  // 40 carrier periods are one of the modulation
  options.steps_per_period = 20000;
  const Portrait seen = portrait(paper(false, true), figure_9, options);
  EXPECT_NEAR(std::max(-seen.displacement_m.low, seen.displacement_m.high), 1.5397, 1.0e-3);
  EXPECT_NEAR(std::max(-seen.velocity_m_s.low, seen.velocity_m_s.high), 2.1371, 1.0e-3);
  EXPECT_NEAR(seen.negative_friction, 0.0398, 5.0e-4);
}

// Figure 10 of the paper: both models have the torus, only the state-variable model overshoots the
// plane of zero velocity.
TEST(Portrait, OnlyTheStateVariableModelOvershoots) {
  PortraitOptions options;
  options.x_m = 0.5;
  options.periods = 300;
  const Portrait coulomb = portrait(paper(true, false), figure_10, options);
  const Portrait memory = portrait(paper(true, true), figure_10, options);
  EXPECT_GT(coulomb.arrivals, 100);
  EXPECT_GT(memory.arrivals, 100);
  EXPECT_GT(coulomb.sticking, 0.2);
  EXPECT_EQ(memory.sticking, 0.0);
  EXPECT_LT(coulomb.overshoot, 1.0e-3);
  EXPECT_GT(memory.overshoot, 0.01);
  EXPECT_EQ(coulomb.negative_friction, 0.0);
}

TEST(PoincareSection, HasOnePointPerPeriodAtItsPhase) {
  PortraitOptions options;
  options.transient = 3;
  options.periods = 50;
  options.phase = 0.25;
  const auto points = poincare_section(paper(true, true), figure_10, options);
  ASSERT_EQ(points.size(), 50U);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double turns = points[i].time_s / figure_10.period_s();
    EXPECT_NEAR(turns, 3.25 + static_cast<double>(i), 1.0e-9);
  }
}

TEST(PoincareSection, PeriodicMotionIsOnePoint) {
  auto model = paper(false, true);
  model.oscillator.damping_n_s_m = physics::Parameter{0.3};
  PortraitOptions options;
  options.transient = 200;
  options.periods = 20;
  const auto points = poincare_section(model, {2.0, 1.5, 0.0}, options);
  for (const Point& point : points) EXPECT_NEAR(point.x(), points.front().x(), 1.0e-6);
}

TEST(Trajectory, EndsAfterItsPeriods) {
  PortraitOptions options;
  options.transient = 0;
  options.periods = 2;
  options.steps_per_period = 100;
  const auto points = trajectory(paper(true, true), figure_10, options, 10);
  ASSERT_EQ(points.size(), 21U);
  EXPECT_EQ(points.front().time_s, 0.0);
  EXPECT_NEAR(points.back().time_s, 2.0 * figure_10.period_s(), 1.0e-9);
}

}  // namespace
}  // namespace stickslip::dynamics
