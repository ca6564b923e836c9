// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/score.h"

#include <gtest/gtest.h>

#include <cmath>

#include "diagnosis/held_out.h"
#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using test::all_windows;
using test::driven_mass;
using test::experiment_of;
using test::record;
using test::with_term;

TEST(Score, OfTheTrueModelEqualsThatOfTheNoise) {
  const std::vector<Experiment> experiments = {
      experiment_of(record(driven_mass(), 12.0), driven_mass())};
  const Hypothesis hypothesis(driven_mass());
  const Score got = score(all_windows(experiments), hypothesis, std::vector<double>(2, 0.0));
  EXPECT_NEAR(got.chi2_per_sample, 1.0, 0.1);
  // Predictions start from states that were themselves estimated from noise.
  ASSERT_TRUE(got.rmse[0].has_value());
  EXPECT_GT(*got.rmse[0], 2.0e-5);
  EXPECT_LT(*got.rmse[0], 4.0e-5);
  EXPECT_NEAR(*got.nrmse[0], *got.rmse[0] / experiments[0].channel_std[0], 1.0e-12);
  EXPECT_FALSE(got.rmse[1].has_value()) << "no velocity was recorded";
}

TEST(ScoreGain, IsTheSumOverWindowsWithItsStandardError) {
  HeldOut before;
  before.loss = {10.0, 12.0, 14.0, 20.0};
  HeldOut after;
  after.loss = {9.0, 9.0, 9.0, 13.0};
  const ScoreGain gain = score_gain(before, after);
  EXPECT_DOUBLE_EQ(gain.value, 16.0);
  // Gains of 1, 3, 5 and 7: a standard deviation of sqrt(20 / 3), times the root of four windows.
  EXPECT_DOUBLE_EQ(gain.se, 2.0 * std::sqrt(20.0 / 3.0));
  EXPECT_EQ(score_gain(before, before).se, 0.0);
}

// A state that the readings show well is paid for in every window; one that they do not show only
// has its prior.
TEST(Score, OfAHiddenStateIncludesWhatItsFreedomCosts) {
  const auto truth = driven_mass();
  const std::vector<Experiment> experiments = {experiment_of(record(truth, 12.0), truth)};
  const Task task = all_windows(experiments);
  const std::vector<double> z(2, 0.0);
  const Fit fitted = fit_states(task, Hypothesis(truth), z, {});
  for (const double cost : fitted.state_cost) {
    // Displacement and velocity, known thousands of times better than their priors.
    EXPECT_GT(cost, 2.0 * std::log(10.0));
    EXPECT_LT(cost, 2.0 * std::log(1.0e6));
  }
}

TEST(Score, IsWorseForAModelThatLacksAForce) {
  const auto truth = with_term(driven_mass(), "dry_friction", {{"friction_force_n", {0.5}}});
  const std::vector<Experiment> experiments = {experiment_of(record(truth, 12.0), driven_mass())};
  const std::vector<double> z(2, 0.0);
  const Score lacking = score(all_windows(experiments), Hypothesis(driven_mass()), z);
  const Score whole = score(all_windows(experiments), Hypothesis(truth), z);
  EXPECT_GT(lacking.chi2_per_sample, 5.0 * whole.chi2_per_sample);
  EXPECT_GT(*lacking.rmse[0], 5.0 * *whole.rmse[0]);
  EXPECT_GT(lacking.nll_per_sample, whole.nll_per_sample);
}

TEST(PredictAhead, OmitsWindowsWithoutPrecedingData) {
  const std::vector<Experiment> experiments = {
      experiment_of(record(driven_mass(), 6.0), driven_mass())};
  ASSERT_EQ(experiments[0].windows[0].begin, 0U);
  const PredictionErrors ahead = predict_ahead(all_windows(experiments), Hypothesis(driven_mass()),
                                               std::vector<double>(2, 0.0));
  EXPECT_EQ(ahead.count[0], 0);
  EXPECT_GT(ahead.count[1], 0);
}

TEST(FreeRun, OfTheTrueModelFollowsTheRecording) {
  const std::vector<Experiment> experiments = {
      experiment_of(record(driven_mass(), 12.0), driven_mass())};
  const FreeRun run =
      free_run(all_windows(experiments), Hypothesis(driven_mass()), std::vector<double>(2, 0.0));
  ASSERT_TRUE(run.rmse[0].has_value());
  // Over 12 s and 24 periods of some 60 mm, steps of 1 ms lose a little phase.
  EXPECT_LT(*run.rmse[0], 1.5e-4);
}

TEST(FreeRun, StaysFiniteIfTheModelDiverges) {
  const std::vector<Experiment> experiments = {
      experiment_of(record(driven_mass(), 12.0), driven_mass())};
  const auto wild = with_term(driven_mass(), "cubic_stiffness", {{"k3_n_m3", {-1.0e9}}});
  const FreeRun run =
      free_run(all_windows(experiments), Hypothesis(wild), std::vector<double>(2, 0.0));
  ASSERT_TRUE(run.rmse[0].has_value());
  EXPECT_TRUE(std::isfinite(*run.rmse[0]));
}

TEST(NoiseSigma, IsTheLargestOfAllRecordings) {
  std::vector<Experiment> experiments(2);
  experiments[0].noise_std[0] = 1.0e-5;
  experiments[1].noise_std[0] = 3.0e-5;
  EXPECT_EQ(noise_sigma(experiments)[0], 3.0e-5);
  EXPECT_EQ(noise_sigma(experiments)[1], 1.0) << "of a channel that was not recorded";
}

}  // namespace
}  // namespace stickslip::diagnosis
