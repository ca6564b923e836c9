// SPDX-License-Identifier: Apache-2.0
#include "observer/consistency.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/unit/observer/bench.h"

namespace stickslip::observer {
namespace {

using test::Law;

constexpr std::size_t channel = 1;

/// Share of independent runs in which the running means end outside their bounds.
struct Outside {
  double nis = 0.0;
  double whiteness = 0.0;
};

/// For innovations of standard deviation `scale` and lag-one correlation `correlation`.
Outside outside(double scale, double correlation) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  constexpr int runs = 2000;
  Outside out;
  for (int i = 0; i < runs; ++i) {
    Consistency consistency(0.02);
    double before = normal(random);
    for (int k = 0; k < 600; ++k) {
      const double fresh = normal(random);
      const double z =
          scale * (std::sqrt(1.0 - correlation * correlation) * fresh + correlation * before);
      before = fresh;
      consistency.add_innovation(channel, z);
      consistency.add_nis(z * z, 1);
    }
    const RunningMean& nis = consistency.nis();
    const RunningMean& whiteness = consistency.whiteness(channel);
    out.nis += std::abs(nis.mean() - 1.0) > nis.bound() ? 1.0 / runs : 0.0;
    out.whiteness += std::abs(whiteness.mean()) > whiteness.bound() ? 1.0 / runs : 0.0;
  }
  return out;
}

TEST(ConsistencyTest, FivePercentOfMeansAreOutsideTheBoundsForWhiteUnitInnovations) {
  const Outside out = outside(1.0, 0.0);
  EXPECT_NEAR(out.nis, 0.05, 0.02);
  EXPECT_NEAR(out.whiteness, 0.05, 0.02);
}

TEST(ConsistencyTest, DetectsExcessiveInnovations) { EXPECT_GT(outside(1.3, 0.0).nis, 0.9); }

TEST(ConsistencyTest, DetectsCorrelatedInnovations) { EXPECT_GT(outside(1.0, 0.5).whiteness, 0.9); }

TEST(ConsistencyTest, BoundDecreasesToThatOfTheForgettingFactor) {
  RunningMean mean;
  EXPECT_EQ(mean.bound(), 0.0);
  mean.add(1.0, 2.0, 0.001);
  EXPECT_NEAR(mean.bound(), 1.96 * std::sqrt(2.0), 1.0e-12);
  for (int k = 0; k < 20000; ++k) mean.add(1.0, 2.0, 0.001);
  EXPECT_NEAR(mean.bound(), 1.96 * std::sqrt(2.0 * 0.001 / (2.0 - 0.001)), 1.0e-6);
}

TEST(ConsistencyTest, FirstInnovationAfterReinitialisationHasNoPredecessor) {
  Consistency consistency(0.001);
  consistency.add_innovation(channel, 100.0);
  consistency.reinitialise();
  consistency.add_innovation(channel, 100.0);
  EXPECT_EQ(consistency.whiteness(channel).mean(), 0.0);
}

TEST(ConsistencyTest, IsReportedByTheObserver) {
  const physics::Model model = test::paper_rig(Law::coulomb);
  const auto samples = test::run_observer(model, model, {.duration_s = 8.0});
  const FrictionEstimate& last = samples.back().estimate;
  EXPECT_GT(last.nis_mean, 0.5);
  EXPECT_LT(last.nis_mean, 1.5);
  EXPECT_LT(last.nis_mean_low, 1.0);
  EXPECT_GT(last.nis_mean_high, 1.0);
  EXPECT_GT(last.whiteness_bound[index_of(Channel::velocity)], 0.0);
  EXPECT_LT(std::abs(last.whiteness[index_of(Channel::velocity)]), 0.3);
  EXPECT_EQ(last.whiteness_bound[index_of(Channel::drive_force)], 0.0);
}

}  // namespace
}  // namespace stickslip::observer
