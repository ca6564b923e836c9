// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/live_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using physics::Relation;
using test::driven_mass;
using test::record;
using test::with_term;
using ::testing::HasSubstr;

/// Checks the frames up to `until_s`, every quarter of a second, as a daemon does.
void run(LiveCheck& check, const std::vector<Frame>& frames, double from_s, double until_s) {
  for (double time_s = from_s + LiveCheck::every_s; time_s <= until_s + 1.0e-9;
       time_s += LiveCheck::every_s) {
    std::size_t end = 0;
    while (end < frames.size() && frames[end].time_s() < time_s) ++end;
    const auto latest = latest_span(std::span(frames).first(end));
    if (latest.empty()) continue;
    check.update(latest);
    if (check.wants_explanation()) check.explain();
  }
}

physics::Model stiffening() {
  return with_term(driven_mass(), "cubic_stiffness", {{"k3_n_m3", {6.0e5}}});
}

/// The first `before_s` of one recording, then the other.
std::vector<Frame> joined(const std::vector<Frame>& first, const std::vector<Frame>& then,
                          double before_s) {
  std::vector<Frame> out;
  for (std::size_t k = 0; k < first.size() && k < then.size(); ++k) {
    out.push_back(first[k].time_s() < before_s ? first[k] : then[k]);
  }
  return out;
}

TEST(LiveCheck, FollowsASoundRig) {
  LiveCheck check(driven_mass());
  EXPECT_EQ(check.verdict().status, LiveStatus::waiting);
  run(check, record(driven_mass(), 20.0).frames, 0.0, 20.0);
  EXPECT_EQ(check.verdict().status, LiveStatus::follows);
  EXPECT_EQ(check.verdict().alarms, 0U);
  EXPECT_LT(check.verdict().chi2, check.verdict().limit);
  EXPECT_FALSE(check.wants_explanation());
}

TEST(LiveCheck, NoticesWithinTwoSecondsAnEffectThatWasThereFromTheBeginning) {
  LiveCheck check(driven_mass());
  const auto frames = record(stiffening(), 8.0).frames;
  // At rest the spring acts as a linear one; two seconds of motion are enough.
  const std::vector<Frame> moving(frames.begin() + 400, frames.end());
  run(check, moving, 2.0, 4.0);
  const LiveVerdict& verdict = check.verdict();
  ASSERT_EQ(verdict.status, LiveStatus::broken);
  ASSERT_FALSE(verdict.explanations.empty());
  EXPECT_EQ(verdict.explanations.front().relation, Relation::force_balance);
  EXPECT_GT(verdict.explanations.front().probability, 0.3);
  EXPECT_LE(verdict.explanations.front().chi2, verdict.limit);
}

TEST(LiveCheck, NamesAnErrorOfASensorThatSetsIn) {
  const auto frames = record(driven_mass(), 14.0).frames;
  auto wrong = frames;
  for (Frame& frame : wrong) {
    frame.set(Channel::displacement, frame[Channel::displacement] + 0.3e-3);
  }
  LiveCheck check(driven_mass());
  run(check, joined(frames, wrong, 8.0), 0.0, 14.0);
  EXPECT_EQ(check.verdict().alarms, 1U);
  EXPECT_NEAR(1.0e-9 * static_cast<double>(check.verdict().since_ns), 8.0, 0.3);
}

// A misfit of a hundred times the noise's power drags the declared model's own fit far away.
TEST(LiveCheck, ExplainsAMisfitFarAboveTheNoise) {
  const auto rubbing = with_term(driven_mass(), "dry_friction", {{"friction_force_n", {1.0}}});
  LiveCheck check(driven_mass());
  run(check, record(rubbing, 12.0).frames, 4.0, 12.0);
  const LiveVerdict& verdict = check.verdict();
  ASSERT_EQ(verdict.status, LiveStatus::broken);
  EXPECT_GT(verdict.chi2, 10.0);
  ASSERT_FALSE(verdict.explanations.empty());
  EXPECT_EQ(verdict.explanations.front().name, "dry_friction");
  EXPECT_TRUE(verdict.is_certain);
}

/// A mass that rubs under a load of 10 N, whose channel is compared.
physics::Model loaded(double load_n, double mu) {
  physics::Model model = driven_mass();
  model.normal_load = physics::NormalLoad{physics::NormalLoadLaw::constant, {load_n, 0.1}, {}};
  model.friction.law = physics::FrictionLaw::coulomb;
  model.friction.mu = {mu, 0.002};
  model.friction.transition_speed_m_s = {1.0e-3};
  physics::Sensor& sensor = model.sensors[index_of(Channel::normal_load)];
  sensor.noise_std = 0.05;
  sensor.gain = physics::Parameter{1.0};
  sensor.offset = physics::Parameter{0.0};
  sensor.delay_s = physics::Parameter{0.0};
  return model;
}

TEST(LiveCheck, WithholdsAnExplanationThatAMeasuredChannelContradicts) {
  // The friction of twice the load, and a load cell that shows the declared one.
  auto frames = record(loaded(20.0, 0.02), 12.0).frames;
  std::mt19937_64 random(1);
  std::normal_distribution<double> noise(10.0, 0.05);
  for (Frame& frame : frames) frame.set(Channel::normal_load, noise(random));
  LiveCheck check(loaded(10.0, 0.02));
  run(check, frames, 4.0, 12.0);
  const LiveVerdict& verdict = check.verdict();
  ASSERT_EQ(verdict.status, LiveStatus::broken);
  ASSERT_FALSE(verdict.explanations.empty()) << "more friction explains it";
  for (const Explanation& each : verdict.explanations) {
    EXPECT_NE(each.relation, Relation::normal_load) << each.statement;
    EXPECT_TRUE(each.agrees);
  }
}

TEST(LiveCheck, FollowsAgainWhenTheDeviationHasPassed) {
  const auto sound = record(driven_mass(), 16.0).frames;
  const auto stiff = record(stiffening(), 16.0).frames;
  auto frames = joined(sound, stiff, 3.0);
  frames = joined(frames, sound, 6.0);
  LiveCheck check(driven_mass());
  run(check, frames, 0.0, 6.0);
  EXPECT_EQ(check.verdict().status, LiveStatus::broken);
  run(check, frames, 6.0, 16.0);
  EXPECT_EQ(check.verdict().status, LiveStatus::follows);
  EXPECT_TRUE(check.verdict().explanations.empty());
}

TEST(LiveCheck, ReportsParametersBeyondTheirDeclaredUncertainties) {
  physics::Model softer = driven_mass();
  softer.oscillator.stiffness_n_m->value -= 12.0 * softer.oscillator.stiffness_n_m->sigma;
  LiveCheck check(driven_mass());
  run(check, record(softer, 8.0).frames, 0.0, 8.0);
  EXPECT_EQ(check.verdict().status, LiveStatus::broken);
}

TEST(LiveCheck, WaitsForARigAtRest) {
  auto frames = record(driven_mass(), 4.0).frames;
  for (Frame& frame : frames) {
    for (const Channel channel : {Channel::displacement, Channel::drive_force}) {
      frame.set(channel, 0.0);
    }
  }
  LiveCheck check(driven_mass());
  run(check, frames, 0.0, 4.0);
  EXPECT_EQ(check.verdict().status, LiveStatus::waiting);
}

TEST(LiveCheck, ExplainsAgainAfterGrowingIntervalsUntilItIsFinal) {
  // Two effects at once: no single one explains the frames.
  physics::Model both = stiffening();
  both = with_term(both, "dry_friction", {{"friction_force_n", {0.4}}});
  const auto frames = record(both, 30.0).frames;
  LiveCheck check(driven_mass());
  int explanations = 0;
  for (std::size_t end = 300; end < frames.size(); end += 50) {
    check.update(latest_span(std::span(frames).first(end)));
    if (!check.wants_explanation()) continue;
    check.explain();
    ++explanations;
  }
  EXPECT_TRUE(check.verdict().is_final);
  EXPECT_LE(explanations, 6);
  EXPECT_EQ(check.verdict().status, LiveStatus::broken);
}

TEST(LiveCheck, RefusesAnImpossibleRateOfFalseAlarms) {
  LiveCheckSettings settings;
  settings.days_between_false_alarms = 0.0;
  EXPECT_THROW(LiveCheck(driven_mass(), settings), std::invalid_argument);
}

TEST(LatestSpan, BeginsAtAMultipleOfTheInterval) {
  std::vector<Frame> frames(1001);
  for (std::size_t k = 0; k < frames.size(); ++k) {
    frames[k].time_ns = 7'000'000 + static_cast<std::int64_t>(k) * 5'000'000;
  }
  const auto span = latest_span(frames);
  ASSERT_FALSE(span.empty());
  EXPECT_EQ(span.back().time_ns, frames.back().time_ns);
  EXPECT_NEAR(1.0e-9 * static_cast<double>(span.front().time_ns), 2.0, 0.005);
  EXPECT_TRUE(latest_span(std::span(frames).first(250)).empty());
  EXPECT_TRUE(latest_span({}).empty());
}

LiveVerdict broken() {
  LiveVerdict out;
  out.status = LiveStatus::broken;
  out.chi2 = 7.25;
  out.limit = 1.35;
  Explanation first;
  first.relation = Relation::sensor;
  first.channel = Channel::velocity;
  first.statement = "The velocity channel is delayed by 4 ms.";
  first.chi2 = 1.0;
  first.probability = 0.6;
  Explanation second;
  second.relation = Relation::force_balance;
  second.statement = "A constant force of 0.1 N acts.";
  second.chi2 = 1.0;
  second.probability = 0.38;
  out.explanations = {first, second};
  return out;
}

TEST(LiveVerdict, SaysWhatIsNotCertain) {
  LiveVerdict verdict = broken();
  EXPECT_EQ(words_for(verdict),
            "the rig does not follow its model: residuals have 7.25 times the power of the noise");
  EXPECT_EQ(
      cause_in_words(verdict),
      "the cause of the model mismatch is not certain yet: The velocity channel is delayed by "
      "4 ms (sensor of velocity, 60 %), or a constant force of 0.1 N acts (force_balance, 38 %)");
  verdict.is_certain = true;
  verdict.explanations.front().probability = 0.9999;
  EXPECT_EQ(cause_in_words(verdict),
            "probable cause of the model mismatch: The velocity channel is delayed by 4 ms "
            "(sensor of velocity, above 99 %)");
  verdict.explanations.front().chi2 = 3.0;
  EXPECT_THAT(cause_in_words(verdict), HasSubstr("no single effect of the catalogue"));
}

}  // namespace
}  // namespace stickslip::diagnosis
