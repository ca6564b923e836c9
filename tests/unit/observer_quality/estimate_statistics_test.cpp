// SPDX-License-Identifier: Apache-2.0
#include "tests/benchmark/estimate_statistics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "tests/benchmark/observer_runs.h"

namespace stickslip::quality {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

TEST(RelativeError, IsOfTheRootMeanSquares) {
  RelativeError error;
  EXPECT_FALSE(error.value());
  error.add(4.0, 3.0);
  error.add(-4.0, -4.0);
  EXPECT_DOUBLE_EQ(error.value().value(), 1.0 / 5.0);
}

TEST(RelativeError, IsAbsentWithoutTruthAndInfiniteForWhatIsNotFinite) {
  RelativeError nothing;
  nothing.add(1.0, 0.0);
  EXPECT_FALSE(nothing.value());
  RelativeError error;
  error.add(1.0, 1.0);
  error.add(nan, 1.0);
  EXPECT_EQ(error.value(), infinity);
}

TEST(Coverage, CountsTheBounds) {
  EXPECT_TRUE(covers(1.0, 0.5, 1.97));
  EXPECT_FALSE(covers(1.0, 0.5, 1.99));
  EXPECT_TRUE(covers(1.0, 0.0, 1.0));
  EXPECT_FALSE(covers(nan, 1.0, 1.0));
  EXPECT_FALSE(covers(1.0, nan, 1.0));
  EXPECT_FALSE(covers(1.0, infinity, 1.0));
  Coverage coverage;
  EXPECT_FALSE(coverage.share());
  coverage.add(1.0, 0.5, 1.9);
  coverage.add(1.0, 0.5, 2.1);
  coverage.add(1.0, 0.5, 0.1);
  coverage.add(1.0, 0.5, 1.0);
  EXPECT_DOUBLE_EQ(coverage.share().value(), 0.75);
}

TEST(Coverage, IsNinetyFivePercentOfGaussianErrors) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> error(0.0, 0.3);
  Coverage coverage;
  for (int i = 0; i < 100000; ++i) coverage.add(error(random), 0.3, 0.0);
  EXPECT_NEAR(coverage.share().value(), 0.95, 0.003);
}

TEST(AreaUnderCurve, CountsPairsAndHalvesTies) {
  // 0.9 wins against both, 0.5 against 0.1 and ties with 0.5: 3.5 of 4 pairs.
  EXPECT_EQ(area_under_curve({{0.5, false}, {0.9, true}, {0.1, false}, {0.5, true}}), 0.875);
  EXPECT_EQ(area_under_curve({{0.2, true}, {0.2, false}, {0.2, false}}), 0.5);
  EXPECT_EQ(area_under_curve({{1.0, true}, {0.0, false}}), 1.0);
  EXPECT_EQ(area_under_curve({{1.0, false}, {0.0, true}}), 0.0);
  // 1 and 2 win against nan, the positive nan ties with it and loses to 0: 4.5 of 6 pairs.
  EXPECT_EQ(area_under_curve({{nan, true}, {1.0, true}, {nan, false}, {0.0, false}, {2.0, true}}),
            0.75);
}

TEST(AreaUnderCurve, NeedsBothClasses) {
  EXPECT_FALSE(area_under_curve({}));
  EXPECT_FALSE(area_under_curve({{1.0, true}, {0.5, true}}));
  EXPECT_FALSE(area_under_curve({{1.0, false}}));
}

TEST(Distribution, IsMedianAndWorstOfWhatIsPresent) {
  EXPECT_FALSE(distribution_of({std::nullopt, std::nullopt}, Worst::largest));
  const auto odd = distribution_of({3.0, std::nullopt, 1.0, 2.0}, Worst::largest);
  ASSERT_TRUE(odd);
  EXPECT_EQ(odd->median, 2.0);
  EXPECT_EQ(odd->worst, 3.0);
  EXPECT_EQ(odd->count, 3U);
  const auto even = distribution_of({4.0, 1.0, infinity, 2.0}, Worst::smallest);
  ASSERT_TRUE(even);
  EXPECT_EQ(even->median, 3.0);
  EXPECT_EQ(even->worst, 1.0);
}

// An estimate with standard deviations of 1e-5 m, 1e-3 m/s, 0.1 and 0.02, in another order than
// that of the NEES.
observer::FrictionEstimate estimate() {
  observer::FrictionEstimate e;
  using observer::Quantity;
  e.quantities = {Quantity::velocity, Quantity::mu, Quantity::theta, Quantity::displacement};
  e.used = 4;
  e.covariance[0][0] = 1.0e-6;
  e.covariance[1][1] = 4.0e-4;
  e.covariance[2][2] = 1.0e-2;
  e.covariance[3][3] = 1.0e-10;
  e.displacement_m = 2.0e-5;
  e.velocity_m_s = -1.0e-3;
  e.theta = 0.5;
  e.mu = 0.76;
  return e;
}

TEST(Nees, IsTheSumOfSquaresWithoutCorrelation) {
  physics::RigTruth truth;
  truth.theta = 0.2;
  // 2, 1, 3 and 2 standard deviations.
  EXPECT_NEAR(runs::nees_of(estimate(), truth, 0.8), 4.0 + 1.0 + 9.0 + 4.0, 1.0e-6);
}

TEST(Nees, UsesCorrelations) {
  observer::FrictionEstimate e = estimate();
  // Correlation 0.6 of theta and mu, errors of 3 and -2 standard deviations:
  // (9 + 4 + 2 * 0.6 * 6) / (1 - 0.36).
  e.covariance[1][2] = e.covariance[2][1] = 0.6 * 0.1 * 0.02;
  physics::RigTruth truth;
  truth.theta = 0.2;
  EXPECT_NEAR(runs::nees_of(e, truth, 0.8), 4.0 + 1.0 + 20.2 / 0.64, 1.0e-6);
}

TEST(Nees, IsInfiniteWithoutPositiveCovariance) {
  observer::FrictionEstimate e = estimate();
  e.covariance[1][2] = e.covariance[2][1] = 1.5 * 0.1 * 0.02;
  EXPECT_EQ(runs::nees_of(e, {}, 0.8), infinity);
  e = estimate();
  e.theta = nan;
  EXPECT_EQ(runs::nees_of(e, {}, 0.8), infinity);
  e = estimate();
  e.covariance[2][2] = nan;
  EXPECT_EQ(runs::nees_of(e, {}, 0.8), infinity);
}

}  // namespace
}  // namespace stickslip::quality
