// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/heterogeneity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace stickslip::diagnosis {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

OwnEstimates independent(const std::vector<double>& value, const std::vector<double>& error) {
  const auto n = static_cast<Eigen::Index>(value.size());
  OwnEstimates out{Eigen::VectorXd(n), Eigen::MatrixXd::Zero(n, n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i);
    out.value[i] = value[k];
    out.covariance(i, i) = error[k] * error[k];
  }
  return out;
}

TEST(Heterogeneity, IsCochransQ) {
  // By hand: weights 100, 25, 100; mean (100 + 50 + 130) / 225; Q = sum of w (x - mean)^2.
  const auto found =
      heterogeneity_of(independent({1.0, 2.0, 1.3}, {0.1, 0.2, 0.1}), common_design(3), 0.05);
  const double mean = 280.0 / 225.0;
  const double q = 100.0 * std::pow(1.0 - mean, 2) + 25.0 * std::pow(2.0 - mean, 2) +
                   100.0 * std::pow(1.3 - mean, 2);
  EXPECT_NEAR(found.coefficient[0], mean, 1.0e-12);
  EXPECT_NEAR(found.covariance(0, 0), 1.0 / 225.0, 1.0e-12);
  EXPECT_NEAR(found.q, q, 1.0e-9);
  EXPECT_EQ(found.freedom, 2);
  EXPECT_NEAR(found.p, std::exp(-0.5 * q), 1.0e-9);  // of two degrees of freedom
}

TEST(Heterogeneity, OfCorrelatedEstimatesIsThatOfTheirDifference) {
  // An error that both have in common says nothing of their difference.
  OwnEstimates both = independent({5.0, 5.3}, {0.1, 0.1});
  both.covariance.array() += 4.0;
  const auto found = heterogeneity_of(both, common_design(2), 0.05);
  EXPECT_NEAR(found.q, 0.3 * 0.3 / 0.02, 1.0e-6);
  EXPECT_EQ(found.freedom, 1);
}

TEST(Heterogeneity, NamesTheRecordingsThatDisagree) {
  const std::vector<double> error(5, 0.1);
  const auto disagreeing = [&](const std::vector<double>& value) {
    return heterogeneity_of(independent(value, error), common_design(5), 0.05).disagreeing;
  };
  EXPECT_THAT(disagreeing({1.0, 1.05, 0.95, 1.02, 0.98}), IsEmpty());
  EXPECT_THAT(disagreeing({1.0, 1.05, 3.0, 1.02, 0.98}), ElementsAre(2));
  EXPECT_THAT(disagreeing({1.0, 2.0, 3.0, 4.0, 5.0}), ElementsAre(0, 1, 2, 3, 4));
}

TEST(Heterogeneity, LeavesNothingOfALineThatHolds) {
  Eigen::MatrixXd line = common_design(4);
  line.conservativeResize(4, 2);
  line.col(1) << -1.5, -0.5, 0.5, 1.5;
  const auto found =
      heterogeneity_of(independent({1.0, 1.5, 2.0, 2.5}, {0.01, 0.01, 0.01, 0.01}), line, 0.05);
  EXPECT_NEAR(found.q, 0.0, 1.0e-9);
  EXPECT_NEAR(found.coefficient[1], 0.5, 1.0e-9);
  EXPECT_EQ(found.freedom, 2);
}

TEST(Spread, IsThatOfSimulatedValues) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  double sum = 0.0;
  int covered = 0;
  constexpr int campaigns = 200;
  for (int i = 0; i < campaigns; ++i) {
    std::vector<double> value;
    for (int k = 0; k < 8; ++k) value.push_back(2.0 + 0.5 * normal(random) + 0.2 * normal(random));
    const Spread found = spread_of(independent(value, std::vector<double>(8, 0.2)));
    sum += found.value * found.value;
    if (found.low <= 0.5 && 0.5 <= found.high) ++covered;
    EXPECT_NEAR(found.mean, 2.0, 4.0 * std::sqrt((0.25 + 0.04) / 8.0));
  }
  // Restricted maximum likelihood is nearly unbiased in the variance.
  EXPECT_NEAR(sum / campaigns, 0.25, 0.035);
  EXPECT_GT(covered, 180);
}

TEST(Spread, OfEqualValuesIsNone) {
  const Spread found = spread_of(independent({1.0, 1.01, 0.99, 1.0}, {0.1, 0.1, 0.1, 0.1}));
  EXPECT_EQ(found.value, 0.0);
  EXPECT_EQ(found.low, 0.0);
  EXPECT_GT(found.high, 0.0);
}

}  // namespace
}  // namespace stickslip::diagnosis
