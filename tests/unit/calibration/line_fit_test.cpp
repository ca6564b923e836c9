// SPDX-License-Identifier: Apache-2.0
#include "tools/calibration/line_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <random>

namespace stickslip::calibration {
namespace {

constexpr double true_offset = 3.2e-5;
constexpr double true_gain = 2100.0;

/// Ascending, then descending, zero at both ends [N].
const std::vector<double> cycle = {0.0, 0.5, 1.0, 1.5, 2.0, 1.5, 1.0, 0.5, 0.0};

/// Readings of an ideal sensor.
std::vector<Point> exact(const std::vector<double>& references, double raw_std = 0.0,
                         double reference_sigma = 0.0) {
  std::vector<Point> out;
  for (const double reference : references) {
    out.push_back({true_offset + reference / true_gain, raw_std, reference,
                   reference == 0.0 ? 0.0 : reference_sigma});
  }
  return out;
}

/// The same with the declared noise; equal references share their error.
std::vector<Point> noisy(std::vector<Point> points, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::map<double, double> error;
  for (Point& point : points) {
    if (!error.contains(point.reference_si)) {
      error[point.reference_si] = point.reference_sigma * normal(random);
    }
    point.raw += error[point.reference_si] / true_gain + point.raw_std * normal(random);
  }
  return points;
}

std::vector<Reason> reasons(const LineFit& fit) {
  std::vector<Reason> out;
  for (const Objection& each : fit.objections) out.push_back(each.reason);
  return out;
}

TEST(LineFit, FindsAnExactLine) {
  for (const double std : {0.0, 1e-8}) {
    const auto points = exact(cycle, std);
    const LineFit found = fit(points);
    ASSERT_TRUE(found.solved);
    EXPECT_THAT(reasons(found), testing::IsEmpty());
    EXPECT_NEAR(found.offset, true_offset, 1e-16);
    EXPECT_NEAR(found.gain, true_gain, 1e-9);
    EXPECT_NEAR(found.residual_std, 0.0, 1e-12);
    EXPECT_EQ(found.weighted, std > 0.0);
  }
}

// Statistics over many calibrations of the same sensor.
struct Coverage {
  double offset = 0.0;  // coverage of the 95 % intervals
  double gain = 0.0;
  double mahalanobis = 0.0;  // mean; 2 for a true covariance
  double offset_bias = 0.0;  // of the mean, in standard errors
  double gain_bias = 0.0;
  double refused = 0.0;
};

Coverage coverage_of(const std::vector<Point>& declared, bool with_std, const FitOptions& options) {
  std::mt19937_64 random(20261122);
  constexpr int rounds = 2000;
  Coverage out;
  double variance_offset = 0.0;
  double variance_gain = 0.0;
  for (int round = 0; round < rounds; ++round) {
    auto points = noisy(declared, random);
    if (!with_std) {
      for (Point& point : points) point.raw_std = 0.0;
    }
    const LineFit found = fit(points, options);
    EXPECT_TRUE(found.solved);
    const config::LineCovariance& c = found.covariance;
    const double offset = found.offset - true_offset;
    const double gain = found.gain - true_gain;
    out.offset += std::abs(offset) < found.coverage_95 * std::sqrt(c.offset) ? 1.0 : 0.0;
    out.gain += std::abs(gain) < found.coverage_95 * std::sqrt(c.gain) ? 1.0 : 0.0;
    const double determinant = c.offset * c.gain - c.offset_gain * c.offset_gain;
    if (!found.scaled) {
      out.mahalanobis += (c.gain * offset * offset - 2.0 * c.offset_gain * offset * gain +
                          c.offset * gain * gain) /
                         determinant;
    } else {
      out.mahalanobis += 2.0;
    }
    out.offset_bias += offset;
    out.gain_bias += gain;
    variance_offset += offset * offset;
    variance_gain += gain * gain;
    out.refused += found.acceptable() ? 0.0 : 1.0;
  }
  out.offset_bias /= std::sqrt(variance_offset);
  out.gain_bias /= std::sqrt(variance_gain);
  out.offset /= rounds;
  out.gain /= rounds;
  out.mahalanobis /= rounds;
  out.refused /= rounds;
  return out;
}

constexpr double no_tolerance = 0.0;  // every significant deviation is an objection

TEST(LineFitCoverage, IntervalsCoverTheTrueValuesIn95Percent) {
  FitOptions options;
  options.accuracy = no_tolerance;
  const Coverage got = coverage_of(exact(cycle, 2e-7, 4e-4), true, options);
  // 2000 rounds: standard deviation 0.5 %. One fit in twenty is widened, which adds 0.2 %.
  EXPECT_NEAR(got.offset, 0.952, 0.016);
  EXPECT_NEAR(got.gain, 0.952, 0.016);
  EXPECT_NEAR(got.mahalanobis, 2.0, 0.15);
  EXPECT_LT(std::abs(got.offset_bias), 3.3);
  EXPECT_LT(std::abs(got.gain_bias), 3.3);
  // Scatter, curvature, hysteresis, drift: four tests of one in a thousand each.
  EXPECT_LT(got.refused, 0.011);
  EXPECT_GT(got.refused, 0.0005);
}

TEST(LineFitCoverage, IsCorrectIfReferencesDominateTheError) {
  FitOptions options;
  options.accuracy = no_tolerance;
  const Coverage got =
      coverage_of(exact({0.0, 0.4, 0.8, 1.2, 1.6, 2.0}, 1e-7, 0.02), true, options);
  EXPECT_NEAR(got.offset, 0.952, 0.016);
  EXPECT_NEAR(got.gain, 0.952, 0.016);
  EXPECT_NEAR(got.mahalanobis, 2.0, 0.15);
  EXPECT_LT(std::abs(got.gain_bias), 3.3);
}

TEST(LineFitCoverage, IsCorrectIfTheScatterIsEstimated) {
  FitOptions options;
  options.accuracy = no_tolerance;
  const Coverage got = coverage_of(exact(cycle, 2e-7, 0.0), false, options);
  EXPECT_NEAR(got.offset, 0.95, 0.016);
  EXPECT_NEAR(got.gain, 0.95, 0.016);
}

TEST(LineFit, ExcessScatterScalesTheUncertainty) {
  std::mt19937_64 random(3);
  auto points = noisy(exact(cycle, 4e-7), random);
  const LineFit correct = fit(points);
  for (Point& point : points) point.raw_std = 1e-8;
  const LineFit optimistic = fit(points);
  ASSERT_TRUE(optimistic.scaled);
  EXPECT_NEAR(std::sqrt(optimistic.covariance.gain / correct.covariance.gain), 1.0, 0.6);
  EXPECT_GT(optimistic.coverage_95, 2.2);
  EXPECT_TRUE(optimistic.acceptable()) << "0.04 % of the span is negligible";
}

TEST(LineFit, CommonUncertaintyOfTheReferencesAddsToTheGain) {
  const auto points = exact(cycle, 1e-9);
  FitOptions options;
  options.scale_sigma = 0.003;
  const LineFit found = fit(points, options);
  EXPECT_NEAR(std::sqrt(found.covariance.gain) / true_gain, 0.003, 1e-5);
}

TEST(LineFit, IsIndependentOfUnits) {
  std::mt19937_64 random(8);
  const auto points = noisy(exact(cycle, 2e-7, 4e-4), random);
  auto large = points;
  for (Point& point : large) {
    point.raw = 1e9 + 1e9 * point.raw;
    point.raw_std *= 1e9;
    point.reference_si *= 1e-6;
    point.reference_sigma *= 1e-6;
  }
  const LineFit a = fit(points);
  const LineFit b = fit(large);
  EXPECT_NEAR(b.gain / a.gain, 1e-15, 1e-20);
  EXPECT_NEAR(*b.chi2_per_dof / *a.chi2_per_dof, 1.0, 1e-5);
  EXPECT_NEAR(b.covariance.gain / a.covariance.gain, 1e-30, 1e-35);
}

// Every reason for refusal, with its message.
TEST(LineFitRefuses, FewerThanThreeReferences) {
  EXPECT_THAT(reasons(fit({})), testing::ElementsAre(Reason::too_few_points));
  EXPECT_THAT(reasons(fit(exact({0.0}, 1e-8))), testing::ElementsAre(Reason::too_few_points));
  const auto two = exact({0.0, 1.0, 0.0, 1.0}, 1e-8);
  const LineFit refused = fit(two);
  EXPECT_FALSE(refused.solved);
  EXPECT_THAT(reasons(refused), testing::ElementsAre(Reason::too_few_points));
  EXPECT_THAT(refused.objections[0].sentence, testing::HasSubstr("at least three"));
  FitOptions options;
  options.two_references = true;
  const LineFit forced = fit(two, options);
  EXPECT_TRUE(forced.solved);
  EXPECT_NEAR(forced.gain, true_gain, 1e-6);
  EXPECT_FALSE(forced.curvature) << "not testable";
}

TEST(LineFitRefuses, EqualReferencesOrEqualReadings) {
  EXPECT_THAT(reasons(fit(exact({1.0, 1.0, 1.0}, 1e-8))), testing::ElementsAre(Reason::no_span));
  auto dead = exact({0.0, 1.0, 2.0}, 1e-8);
  for (Point& point : dead) point.raw = 0.5;
  EXPECT_THAT(reasons(fit(dead)), testing::ElementsAre(Reason::no_span));
}

TEST(LineFitRefuses, UnusablePoints) {
  for (const int field : {0, 1, 2, 3}) {
    auto points = exact(cycle, 1e-8);
    const double not_a_number = std::numeric_limits<double>::quiet_NaN();
    Point& point = points[3];
    (field == 0   ? point.raw
     : field == 1 ? point.raw_std
     : field == 2 ? point.reference_si
                  : point.reference_sigma) = not_a_number;
    const LineFit found = fit(points);
    EXPECT_FALSE(found.solved);
    EXPECT_THAT(reasons(found), testing::ElementsAre(Reason::unusable_point));
    EXPECT_THAT(found.objections[0].sentence, testing::StartsWith("point 4"));
  }
  auto negative = exact(cycle, 1e-8);
  negative[1].raw_std = -1e-8;
  EXPECT_THAT(reasons(fit(negative)), testing::ElementsAre(Reason::unusable_point));
}

TEST(LineFitRefuses, AnOutlierAndNamesIt) {
  auto points = exact({0.0, 0.4, 0.8, 1.2, 1.6, 2.0, 1.8, 1.4, 1.0, 0.6, 0.2}, 1e-7);
  points[3].raw += 0.02 / true_gain;
  const LineFit found = fit(points);
  EXPECT_THAT(reasons(found), testing::ElementsAre(Reason::scatter));
  EXPECT_THAT(found.objections[0].sentence, testing::HasSubstr("point 4 (1.2 SI) makes up"));
  FitOptions newton;
  newton.unit = "N";
  EXPECT_THAT(fit(points, newton).hints, testing::Contains(testing::HasSubstr("point 4 (1.2 N)")));
}

TEST(LineFitRefuses, Curvature) {
  auto points = exact({0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0}, 1e-7);
  for (Point& point : points) {
    const double u = point.reference_si - 1.0;
    point.raw += 0.02 * u * u / true_gain;  // half of 0.02 of 2 N: 0.5 % of the span
  }
  const LineFit found = fit(points);
  EXPECT_THAT(reasons(found), testing::Contains(Reason::curvature));
  EXPECT_NEAR(found.curvature->share, 0.005, 0.0005);
  FitOptions coarse;
  coarse.accuracy = 0.01;
  EXPECT_TRUE(fit(points, coarse).acceptable());
}

TEST(LineFitRefuses, Hysteresis) {
  auto points = exact(cycle, 1e-7);
  for (std::size_t i = 5; i < 8; ++i) points[i].raw += 0.01 / true_gain;
  const LineFit found = fit(points);
  EXPECT_THAT(reasons(found), testing::Contains(Reason::hysteresis));
  EXPECT_NEAR(found.hysteresis->share, 0.005, 1e-4);
  // Also without standard deviations of the readings.
  std::mt19937_64 random(4);
  points = noisy(points, random);
  for (Point& point : points) point.raw_std = 0.0;
  EXPECT_THAT(reasons(fit(points)), testing::Contains(Reason::hysteresis));
}

TEST(LineFitRefuses, ZeroDrift) {
  auto points = exact(cycle, 1e-7);
  points.back().raw += 0.01 / true_gain;
  const LineFit found = fit(points);
  EXPECT_THAT(reasons(found), testing::Contains(Reason::zero_drift));
  EXPECT_NEAR(found.zero_drift->share, 0.005, 1e-4);
  EXPECT_FALSE(fit(exact({0.0, 1.0, 2.0}, 1e-7)).zero_drift) << "not testable";
}

TEST(LineFitRefuses, AnUncertainGain) {
  std::mt19937_64 random(6);
  const LineFit found = fit(noisy(exact(cycle, 6e-5), random));
  EXPECT_THAT(reasons(found), testing::ElementsAre(Reason::gain_uncertain));
}

TEST(LineFit, NamesAnInfluentialPoint) {
  const LineFit found = fit(exact({0.0, 0.01, 0.0, 0.01, 2.0}, 1e-7));
  EXPECT_THAT(found.hints, testing::ElementsAre(testing::HasSubstr("point 5 (2 SI) determines")));
  double sum = 0.0;
  for (const PointResidual& each : found.points) sum += each.leverage;
  EXPECT_NEAR(sum, 2.0, 1e-9) << "two parameters are fitted";
}

TEST(LineFit, RepeatabilityComparesReadingsApproachedFromTheSameSide) {
  auto points = exact({0.0, 1.0, 1.0, 2.0, 1.0, 0.0}, 1e-7);
  points[1].raw += 0.001 / true_gain;
  points[2].raw -= 0.001 / true_gain;
  const LineFit found = fit(points);
  ASSERT_TRUE(found.repeatability_si);
  EXPECT_NEAR(*found.repeatability_si, 0.001 * std::sqrt(2.0), 1e-5);
  EXPECT_FALSE(fit(exact(cycle, 1e-7)).repeatability_si);
}

TEST(CalibrationOf, ContainsPointsAndObjections) {
  auto points = exact(cycle, 1e-7, 1e-4);
  points.back().raw += 0.01 / true_gain;
  const LineFit found = fit(points);
  const config::ChannelCalibration calibration = calibration_of(found, points);
  EXPECT_EQ(calibration.points, points);
  EXPECT_EQ(calibration.gain, found.gain);
  EXPECT_EQ(calibration.valid, (config::ValidRange{0.0, 2.0}));
  EXPECT_THAT(calibration.despite, testing::Contains("zero_drift"));
}

}  // namespace
}  // namespace stickslip::calibration
