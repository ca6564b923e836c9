// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/location.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using test::all_windows;
using test::driven_mass;
using test::experiment_of;
using test::record;
using test::with_fitted_states;

// The true model, with a 5 Hz tone added to the reading from 6 s to 8 s.
TEST(Location, HasTheTimesAndTheBandOfADisturbance) {
  Experiment e = experiment_of(record(driven_mass(), 16.0), driven_mass());
  for (std::size_t k = 0; k < e.samples; ++k) {
    const double t = e.time_s(k);
    if (t >= 6.0 && t < 8.0) e.reading[k][0] += 1.0e-3 * std::sin(2.0 * std::numbers::pi * 5.0 * t);
  }
  const std::vector<Experiment> experiments = {std::move(e)};
  const Task task = all_windows(experiments);
  const Hypothesis hypothesis(driven_mass());
  const Fit fitted = with_fitted_states(task, hypothesis);
  const Location location = locate(task, hypothesis, fitted, physics::Relation::sensor, 1.5);
  EXPECT_EQ(location.relation, physics::Relation::sensor);
  EXPECT_EQ(location.channel, Channel::displacement);
  ASSERT_EQ(location.when_s.size(), 1U);
  EXPECT_NEAR(location.when_s[0].first, 6.0, 0.4);
  EXPECT_NEAR(location.when_s[0].second, 8.0, 0.4);
  ASSERT_TRUE(location.band_hz.has_value());
  EXPECT_LT(location.band_hz->first, 5.0);
  EXPECT_GT(location.band_hz->second, 5.0);
  EXPECT_LT(location.band_hz->second, 12.0);
  EXPECT_THAT(location.statement, ::testing::HasSubstr("a sensor"));
  EXPECT_THAT(location.statement, ::testing::HasSubstr("displacement"));
}

TEST(Location, IsThroughoutTheRecordingWhereNearlyEveryWindowFails) {
  Experiment e = experiment_of(record(driven_mass(), 8.0), driven_mass());
  for (std::size_t k = 0; k < e.samples; ++k) e.reading[k][0] += (k % 2 == 0) ? 1.0e-3 : -1.0e-3;
  const std::vector<Experiment> experiments = {std::move(e)};
  const Task task = all_windows(experiments);
  const Hypothesis hypothesis(driven_mass());
  const Fit fitted = with_fitted_states(task, hypothesis);
  const Location location = locate(task, hypothesis, fitted, physics::Relation::kinematics, 1.5);
  ASSERT_EQ(location.when_s.size(), 1U);
  EXPECT_EQ(location.when_s[0].first, 0.0);
  EXPECT_NEAR(location.when_s[0].second, 8.0, 1.0e-9);
  EXPECT_THAT(location.statement, ::testing::HasSubstr("throughout the recording"));
}

TEST(Location, SaysWhereTheBalancesFailInstead) {
  Balances balances;
  balances.of[index_of(Balance::kinematics)] = BalanceResidual{12.3, 1.0e-9};
  EXPECT_THAT(
      contradiction_by({Balance::kinematics, physics::Relation::sensor, Channel::displacement},
                       balances),
      ::testing::HasSubstr("the reading of displacement instead: 12.3 times"));
  EXPECT_THAT(contradiction_by({Balance::kinematics, physics::Relation::kinematics, std::nullopt},
                               balances),
              ::testing::HasSubstr("velocity and displacement instead"));
}

}  // namespace
}  // namespace stickslip::diagnosis
