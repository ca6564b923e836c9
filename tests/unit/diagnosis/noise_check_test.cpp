// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/noise_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <utility>

#include "diagnosis/noise_estimate.h"
#include "diagnosis/noise_score.h"
#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using test::all_windows;
using test::driven_mass;
using test::experiment_of;
using test::record;
using test::with_term;

NoiseCheck checked(const physics::Model& truth, bool estimated = false) {
  const std::vector<Experiment> experiments{experiment_of(record(truth, 24.0), driven_mass())};
  const Hypothesis hypothesis(driven_mass());
  const std::vector<double> z(hypothesis.unknowns().size(), 0.0);
  return noise_check(all_windows(experiments), hypothesis, z, estimated, {});
}

physics::Model with_noise(double factor) {
  auto truth = driven_mass();
  truth.sensors[index_of(Channel::displacement)].noise_std = factor * 2.0e-5;
  return truth;
}

TEST(NoiseCheck, FindsNoiseAsExpected) {
  const NoiseCheck got = checked(driven_mass());
  EXPECT_TRUE(got.is_noise);
  ASSERT_EQ(got.level.size(), 1U);
  EXPECT_NEAR(got.level[0].level, 1.0, 0.05);
  EXPECT_FALSE(got.level[0].differs);
}

TEST(NoiseCheck, MeasuresNoiseOfAnotherLevel) {
  EXPECT_TRUE(checked(with_noise(0.5)).is_noise);
  for (const double factor : {1.5, 4.0}) {
    const NoiseCheck got = checked(with_noise(factor));
    EXPECT_TRUE(got.is_noise) << factor;
    ASSERT_EQ(got.level.size(), 1U) << factor;
    EXPECT_TRUE(got.level[0].differs);
    EXPECT_NEAR(got.level[0].level, factor, 0.05 * factor);
  }
}

// An estimate may be wrong by a fifth of the power.
TEST(NoiseCheck, AllowsForTheErrorOfAnEstimate) {
  EXPECT_TRUE(checked(with_noise(1.08)).level.at(0).differs);
  EXPECT_FALSE(checked(with_noise(1.08), true).level.at(0).differs);
}

// Neither a small misfit everywhere nor one in a few windows is noise.
TEST(NoiseCheck, TakesNoMisfitForNoise) {
  EXPECT_FALSE(checked(with_term(driven_mass(), "bias_force", {{"force_n", {0.02}}})).is_noise);
  EXPECT_FALSE(checked(with_term(driven_mass(), "force_episode",
                                 {{"force_n", {0.1}}, {"begin_s", {11.0}}, {"end_s", {12.0}}}))
                   .is_noise);
}

// The mean level is the expected one, but noise would scatter by less over the windows.
TEST(NoiseCheck, TakesNoScatteredMisfitForNoiseAsExpected) {
  Experiment e = experiment_of(record(driven_mass(), 24.0), driven_mass());
  std::mt19937_64 random(1);
  std::normal_distribution<double> error(0.0, 4.4e-5);
  for (std::size_t w = 0; w < e.windows.size(); w += 2) {
    for (std::size_t k = e.windows[w].begin; k < e.windows[w].end; ++k) {
      e.reading[k][0] += error(random);
    }
  }
  const std::vector<Experiment> experiments{std::move(e)};
  Task task = all_windows(experiments);
  task.sigma[0] = std::hypot(2.0e-5, 4.4e-5 / std::numbers::sqrt2);
  const Hypothesis hypothesis(driven_mass());
  const std::vector<double> z(hypothesis.unknowns().size(), 0.0);
  const NoiseCheck got = noise_check(task, hypothesis, z, false, {});
  EXPECT_TRUE(got.is_noise);
  EXPECT_NEAR(got.level.at(0).level, 1.0, 0.1);
  EXPECT_FALSE(got.is_expected_noise);
  EXPECT_TRUE(checked(driven_mass()).is_expected_noise);
}

// Errors of displacement and velocity, white and of the declared level, of one cause or of two.
NoiseCheck checked_with_errors(bool of_one_cause) {
  constexpr double error_m = 6.0e-5;
  constexpr double velocity_error_per_s = 10.0;
  physics::Model model = driven_mass();
  physics::Sensor& displacement = model.sensors[index_of(Channel::displacement)];
  displacement.noise_std = error_m;
  physics::Sensor& velocity = model.sensors[index_of(Channel::velocity)];
  velocity = displacement;
  velocity.noise_std = velocity_error_per_s * error_m;
  constexpr std::uint8_t channels =
      test::bits_of_displacement_and_force | (1U << index_of(Channel::velocity));
  protocol::Recording recording = record(model, 24.0, 1, false, test::swelling_force_n, channels);
  std::mt19937_64 random(1);
  std::normal_distribution<double> error(0.0, error_m);
  for (Frame& frame : recording.frames) {
    const double of_displacement = error(random);
    const double of_velocity = of_one_cause ? of_displacement : error(random);
    frame.set(Channel::displacement, frame[Channel::displacement] + of_displacement);
    frame.set(Channel::velocity, frame[Channel::velocity] + velocity_error_per_s * of_velocity);
  }
  const std::vector<Experiment> experiments{experiment_of(recording, model)};
  Task task = all_windows(experiments);
  task.sigma[index_of(Channel::displacement)] = error_m;
  task.sigma[index_of(Channel::velocity)] = velocity_error_per_s * error_m;
  const Hypothesis hypothesis(model);
  const std::vector<double> z(hypothesis.unknowns().size(), 0.0);
  return noise_check(task, hypothesis, z, false, {});
}

// Missing physics moves all channels; each instrument has noise of its own.
TEST(NoiseCheck, TakesNoErrorThatTwoChannelsShareForNoise) {
  EXPECT_TRUE(checked_with_errors(false).is_expected_noise);
  EXPECT_FALSE(checked_with_errors(true).is_expected_noise);
}

// The loss of 24 s with a slow error of that size [m] if the noise is taken for white, less that if
// it is taken for coloured: with the levels and the colour that the recording has.
double gain_of_colour(double slow_m, const NoiseColour& colour) {
  protocol::Recording recording = record(driven_mass(), 24.0);
  test::add_slow_error(recording, slow_m, 3);
  const std::vector<Experiment> experiments{experiment_of(recording, driven_mass())};
  const Hypothesis hypothesis(driven_mass());
  const std::vector<double> z(hypothesis.unknowns().size(), 0.0);
  Task white = all_windows(experiments);
  Task coloured = white;
  coloured.colour[index_of(Channel::displacement)] = colour;
  coloured.sigma.fill(std::hypot(2.0e-5, 6.0e-5));
  return noise_loss(white, hypothesis, z) - noise_loss(coloured, hypothesis, z);
}

TEST(NoiseLoss, DistinguishesSlowNoiseFromWhite) {
  const NoiseColour colour{0.9, test::slow_error_s};
  EXPECT_GT(gain_of_colour(6.0e-5, colour), 100.0);
  EXPECT_LT(gain_of_colour(0.0, colour), -100.0);
}

// The level in the residuals of a rig whose noise was taken for `assumed` times what it is, without
// a declaration.
double learned_level(double assumed) {
  std::vector<Experiment> experiments{experiment_of(record(driven_mass(), 24.0), driven_mass())};
  experiments.front().noise_declared.fill(false);
  const Hypothesis hypothesis(driven_mass());
  const std::vector<double> z(hypothesis.unknowns().size(), 0.0);
  Task task = all_windows(experiments);
  const double noise = std::exchange(task.sigma[0], assumed * task.sigma[0]);
  const Fit fitted = fit_states(task, hypothesis, z, {});
  const NoiseEstimate got = noise_in_residuals(task, hypothesis, fitted, false, {});
  EXPECT_TRUE(got.colour[0].is_white());
  return got.sigma[0] / noise;
}

TEST(NoiseEstimate, CorrectsAWrongLevelOfWhiteNoise) {
  EXPECT_NEAR(learned_level(0.65), 1.0, 0.04);
  EXPECT_NEAR(learned_level(1.6), 1.0, 0.04);
  EXPECT_EQ(learned_level(1.0), 1.0);
}

}  // namespace
}  // namespace stickslip::diagnosis
