// SPDX-License-Identifier: Apache-2.0
// Gains over windows: what counts as beyond chance.
#include "diagnosis/held_out.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <utility>

#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

HeldOut with_losses(std::vector<double> loss) {
  HeldOut out;
  out.chi2 = 100.0;
  out.typical_chi2 = 100.0;
  out.loss = std::move(loss);
  return out;
}

// Relative to no loss at all: what was lost before is the gain. No more than noise is left.
HeldOut nothing_lost(std::size_t windows) {
  HeldOut out = with_losses(std::vector<double>(windows, 0.0));
  out.chi2 = 10.0;
  out.typical_chi2 = 1.0;
  return out;
}

// Twelve windows gain, one of them as much as all others together fifty times: the standard error
// shows chance.
TEST(Gain, OfEveryWindowCountsHoweverUnequal) {
  std::vector<double> gains{3.0, 5.0, 2.0, 4.0, 6.0, 3.0, 4.0, 5.0, 2.0, 3.0, 4.0, 2000.0};
  const HeldOut before = with_losses(gains);
  const HeldOut after = nothing_lost(gains.size());
  EXPECT_LT(gain_z(before, after), 1.5);
  EXPECT_DOUBLE_EQ(sign_chance(before, after), 1.0 / 4096.0);
  EXPECT_TRUE(is_gain(before, after, false, {}, 0.0));
}

// Eight windows of like signs are chance once in 256 times; their net gain without the best one is
// 7 nats, a likelihood ratio of 1100.
TEST(Gain, IsBeyondChanceAtTheRateOfFalseAlarms) {
  const HeldOut before = with_losses({0.2, 0.3, 0.5, 1.0, 1.2, 1.8, 2.0, 9.0});
  const HeldOut after = nothing_lost(before.loss.size());
  Criteria criteria;
  EXPECT_FALSE(is_gain(before, after, true, criteria, 0.0)) << "1 in 2000";
  criteria.false_alarm_rate = 0.02;
  EXPECT_TRUE(is_gain(before, after, true, criteria, 0.0)) << "1 in 1000";
  HeldOut far_from_noise = after;
  far_from_noise.typical_chi2 = 10.0;
  EXPECT_FALSE(is_gain(before, far_from_noise, false, criteria, 0.0)) << "the noise is not known";
}

// The calibration had put a number 5 standard deviations away, which the effect takes back: 12 nats
// are the evidence, not what the windows show.
TEST(Gain, IsThatOfADeclaredNumberTooWhichTheEffectTakesBack) {
  HeldOut before = with_losses({0.5, -0.4, 0.2, -0.9, 0.1, 0.4, -0.3, 0.2});
  HeldOut after = nothing_lost(before.loss.size());
  EXPECT_FALSE(is_gain(before, after, true, {}, 0.0));
  before.prior_penalty = 12.5;
  EXPECT_TRUE(is_gain(before, after, true, {}, 0.0));
  after.typical_chi2 = 10.0;
  EXPECT_FALSE(is_gain(before, after, true, {}, 0.0)) << "more than noise is left, and four lose";
  after.typical_chi2 = 1.0;
  std::swap(before.prior_penalty, after.prior_penalty);
  EXPECT_FALSE(is_gain(before, after, true, {}, 0.0));
}

// Beside a formula that may be wrong, a declared number taken back counts like the residuals.
TEST(Gain, ExceedsWhatFormulasMayLeave) {
  HeldOut before = with_losses({0.5, -0.4, 0.2, -0.9, 0.1, 0.4, -0.3, 0.2});
  HeldOut after = nothing_lost(before.loss.size());
  before.chi2 = after.chi2 = 1.0;
  after.fitted.count.assign(after.loss.size(), 125);
  before.prior_penalty = 12.5;
  EXPECT_TRUE(is_gain(before, after, true, {}, 0.024)) << "25 of 1000 samples";
  EXPECT_FALSE(is_gain(before, after, true, {}, 0.026));
}

TEST(Gain, OfFewWindowsIsChance) {
  std::vector<double> gains(20, 0.1);
  for (std::size_t w = 0; w < gains.size(); w += 2) gains[w] = -0.1;
  gains[3] = gains[12] = gains[17] = 300.0;
  const HeldOut before = with_losses(gains);
  HeldOut after = nothing_lost(gains.size());
  after.typical_chi2 = 10.0;
  EXPECT_GT(sign_chance(before, after), 0.05) << "three windows have eight sets of signs";
  EXPECT_FALSE(is_gain(before, after, false, {}, 0.0));
}

// Heavy tails, for which a standard error holds nothing: the share below a level is the level.
TEST(Gain, ByChanceIsAsRareAsItsLevel) {
  std::mt19937_64 random(7);
  std::cauchy_distribution<double> gain;
  for (const std::size_t windows : {std::size_t{12}, std::size_t{30}}) {
    int below = 0;
    constexpr int trials = 200;
    for (int trial = 0; trial < trials; ++trial) {
      std::vector<double> gains(windows);
      for (double& each : gains) each = gain(random);
      if (sign_chance(with_losses(gains), nothing_lost(windows)) < 0.1) ++below;
    }
    EXPECT_NEAR(below, 0.1 * trials, 17) << "four standard deviations; " << windows << " windows";
  }
}

// A zero that is off by a known amount, of a gauge that states are guessed from, costs nothing: no
// hypothesis of another force gains by it.
TEST(Gain, IsNotThatOfAGaugeThatReadsAsTheStatesAreGuessed) {
  const auto recording = test::record(test::driven_mass(), 12.0);
  const auto loss = [](const protocol::Recording& of, double offset_m) {
    physics::Model model = test::driven_mass();
    model.sensors[index_of(Channel::displacement)].offset = physics::Parameter{offset_m};
    const std::vector<Experiment> experiments = {test::experiment_of(of, model)};
    const Hypothesis hypothesis(model);
    const std::vector<double> z(hypothesis.unknowns().size(), 0.0);
    return held_out_score(test::all_windows(experiments), hypothesis, z, true).total_loss();
  };
  constexpr double offset_m = 0.05;
  protocol::Recording off = recording;
  for (Frame& frame : off.frames) {
    frame.set(Channel::displacement, frame[Channel::displacement] + offset_m);
  }
  EXPECT_NEAR(loss(off, offset_m), loss(recording, 0.0), 0.1);
}

// A window in a local minimum makes a hypothesis no worse than one that found the states.
TEST(Gain, IsNotThatOfAnotherStartOfAWindow) {
  const std::vector<Experiment> experiments = {
      test::experiment_of(test::record(test::driven_mass(), 12.0), test::driven_mass())};
  const Task task = test::all_windows(experiments);
  const Hypothesis hypothesis(test::driven_mass());
  const std::vector<double> z(hypothesis.unknowns().size(), 0.0);
  const HeldOut found = held_out_score(task, hypothesis, z, true);
  Fit lost = found.fitted;
  lost.chi2[2] *= 50.0;
  lost.state[2].fill(1.0);
  const HeldOut stuck = score_of(lost, task, hypothesis, z, true);
  ASSERT_GT(stuck.loss[2], found.loss[2] + 10.0);
  const HeldOut mended = rescored_from(found, hypothesis, task, hypothesis, z, stuck, true);
  EXPECT_NEAR(mended.loss[2], found.loss[2], 0.01);
  EXPECT_NEAR(mended.chi2, found.chi2, 0.01);
  for (std::size_t w = 0; w < found.loss.size(); ++w) {
    EXPECT_LE(mended.loss[w], stuck.loss[w]) << w;
  }
}

}  // namespace
}  // namespace stickslip::diagnosis
