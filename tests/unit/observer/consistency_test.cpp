#include "observer/consistency.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/unit/observer/bench.h"

namespace stickslip::observer {
namespace {

using test::Law;

constexpr std::size_t channel = 1;

/// Innovations whose parts that two frames share are `shared` of them: how often the running means
/// lie outside their bounds, over many independent stretches.
struct Outside {
  double nis = 0.0;
  double whiteness = 0.0;
};

Outside outside(double scale, double shared) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  constexpr int stretches = 2000;
  Outside out;
  for (int i = 0; i < stretches; ++i) {
    Consistency consistency(0.02);
    double before = normal(random);
    for (int k = 0; k < 600; ++k) {
      const double fresh = normal(random);
      const double z = scale * (std::sqrt(1.0 - shared * shared) * fresh + shared * before);
      before = fresh;
      consistency.take(channel, z);
      consistency.take_frame(z * z, 1);
    }
    const RunningMean& nis = consistency.nis();
    const RunningMean& whiteness = consistency.whiteness(channel);
    out.nis += std::abs(nis.mean() - 1.0) > nis.bound() ? 1.0 / stretches : 0.0;
    out.whiteness += std::abs(whiteness.mean()) > whiteness.bound() ? 1.0 / stretches : 0.0;
  }
  return out;
}

TEST(ConsistencyTest, OfWhiteUnitInnovationsOneMeanInTwentyIsOutsideItsBounds) {
  const Outside out = outside(1.0, 0.0);
  EXPECT_NEAR(out.nis, 0.05, 0.02);
  EXPECT_NEAR(out.whiteness, 0.05, 0.02);
}

TEST(ConsistencyTest, SeesInnovationsThatAreTooLarge) { EXPECT_GT(outside(1.3, 0.0).nis, 0.9); }

TEST(ConsistencyTest, SeesInnovationsThatHangTogether) {
  EXPECT_GT(outside(1.0, 0.5).whiteness, 0.9);
}

TEST(ConsistencyTest, ItsBoundIsWideAtFirstAndThenThatOfTheMemory) {
  RunningMean mean;
  EXPECT_EQ(mean.bound(), 0.0);
  mean.take(1.0, 2.0, 0.001);
  EXPECT_NEAR(mean.bound(), 1.96 * std::sqrt(2.0), 1.0e-12);
  for (int k = 0; k < 20000; ++k) mean.take(1.0, 2.0, 0.001);
  EXPECT_NEAR(mean.bound(), 1.96 * std::sqrt(2.0 * 0.001 / (2.0 - 0.001)), 1.0e-6);
}

TEST(ConsistencyTest, AFilterThatBeganAnewHasNoInnovationBefore) {
  Consistency consistency(0.001);
  consistency.take(channel, 100.0);
  consistency.begin_anew();
  consistency.take(channel, 100.0);
  EXPECT_EQ(consistency.whiteness(channel).mean(), 0.0);
}

TEST(ConsistencyTest, TheObserverTellsIt) {
  const physics::Model model = test::paper_rig(Law::coulomb);
  const auto moments = test::watch(model, model, {.duration_s = 8.0});
  const FrictionEstimate& last = moments.back().estimate;
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
