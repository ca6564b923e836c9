// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/friction_picture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "bench.h"
#include "diagnosis/diagnosis.h"

namespace stickslip::diagnosis {
namespace {

physics::Model with_stribeck() {
  physics::Model model = test::driven_mass();
  model.friction = {physics::FrictionLaw::coulomb, {2.0}, {1.0e-3}, {}};
  model.terms = {{"stribeck", {}, {{"static_ratio", {1.5}}, {"stribeck_speed_m_s", {0.05}}}},
                 {"bias_force", {}, {{"force_n", {7.0}}}}};
  return model;
}

TEST(FrictionCycle, IsAClosedLoopOfFrictionAndItsTermsOnly) {
  Experiment experiment;
  experiment.largest.displacement_m = 0.01;
  experiment.largest.velocity_m_s = 0.2;
  const FrictionCycle cycle = friction_cycle(with_stribeck(), experiment);
  ASSERT_GT(cycle.force_n.size(), 100U);
  EXPECT_EQ(cycle.force_n.front(), cycle.force_n.back());
  EXPECT_EQ(cycle.velocity_m_s.front(), cycle.velocity_m_s.back());
  for (std::size_t i = 0; i < cycle.force_n.size(); ++i) {
    const double v = cycle.velocity_m_s[i];
    if (std::abs(v) < 0.01) continue;  // the reversal itself
    const double expected = 2.0 * (1.0 + 0.5 * std::exp(-(v / 0.05) * (v / 0.05)));
    EXPECT_NEAR(cycle.force_n[i], std::copysign(expected, v), 0.05) << "at " << v << " m/s";
  }
}

TEST(FrictionCycle, OfARigThatRestedIsEmpty) {
  EXPECT_TRUE(friction_cycle(with_stribeck(), Experiment{}).force_n.empty());
}

}  // namespace
}  // namespace stickslip::diagnosis
