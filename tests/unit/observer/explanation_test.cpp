#include "observer/explanation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "tests/unit/observer/changing_rig.h"
#include "tests/unit/observer/model_check_run.h"

namespace stickslip::observer {
namespace {

using physics::Relation;
using test::Change;
using test::Law;

constexpr double change_s = 2.0;

/// Frames of a rig that changes after two seconds of sliding.
std::vector<Frame> frames_of(const physics::Model& real, Change change, double duration_s,
                             std::uint64_t seed) {
  constexpr int pieces = 6;
  std::mt19937_64 random(seed);
  test::ChangingRig rig(real, test::period_s / pieces, seed);
  const test::ModulatedBase drive{.amplitude_m = 0.014, .depth = 0.3};
  std::vector<Frame> frames;
  const auto count = std::llround(duration_s / test::period_s);
  for (long long k = 1; k <= count; ++k) {
    if (k == std::llround(change_s / test::period_s)) {
      if (change == Change::late_force) rig.delay(Channel::friction_force, 5);
      if (change == Change::late_velocity) rig.delay(Channel::velocity, 5);
      if (change == Change::late_displacement) rig.delay(Channel::displacement, 5);
      const physics::Model next = test::changed(real, change, random);
      if (!(next == real)) rig.become(next);
    }
    for (int piece = 1; piece <= pieces; ++piece) {
      const double t = static_cast<double>(k - 1) + static_cast<double>(piece) / pieces;
      rig.step(drive(t * test::period_s));
    }
    frames.push_back(rig.read());
  }
  return frames;
}

ModelVerdict alarm() {
  ModelVerdict out;
  out.status = ModelStatus::broken;
  out.since_ns = std::llround(1.0e9 * change_s);
  out.reported_ns = out.since_ns + 2'000'000'000;
  return out;
}

class EachChange : public testing::TestWithParam<Change> {};

TEST_P(EachChange, IsExplained) {
  for (const Law law : {Law::coulomb, Law::state_variable}) {
    const physics::Model model = test::paper_rig(law);
    const auto frames = frames_of(model, GetParam(), 6.2, 11);
    const auto found = explanations_of(model, test::period_s, frames, alarm());
    ASSERT_FALSE(found.empty());
    EXPECT_TRUE(test::is_right(GetParam(), found.front())) << found.front().words;
    EXPECT_GT(found.front().probability, 0.9) << found.front().words;
    EXPECT_GT(found.front().log_likelihood, 20.0);
  }
}

INSTANTIATE_TEST_SUITE_P(Of, EachChange, testing::ValuesIn(test::changes),
                         [](const testing::TestParamInfo<Change>& info) {
                           std::string name(test::name_of(info.param));
                           std::replace(name.begin(), name.end(), ' ', '_');
                           std::replace(name.begin(), name.end(), '%', 'p');
                           return name;
                         });

TEST(ExplanationTest, EstimatesTheSizeOfTheChange) {
  const physics::Model model = test::paper_rig(Law::coulomb);
  const auto moved =
      explanations_of(model, test::period_s, frames_of(model, Change::mu_up, 6.2, 12), alarm());
  ASSERT_FALSE(moved.empty());
  EXPECT_NEAR(moved.front().size, 1.2, 0.02);
  EXPECT_NE(moved.front().words.find("instead of 0.8"), std::string::npos) << moved.front().words;
  const auto late = explanations_of(model, test::period_s,
                                    frames_of(model, Change::late_force, 6.2, 13), alarm());
  ASSERT_FALSE(late.empty());
  EXPECT_NEAR(late.front().size, 0.005, 0.0004);
}

TEST(ExplanationTest, StartsFromTheEstimatesBeforeTheBreak) {
  physics::Model model = test::paper_rig(Law::coulomb);
  const auto frames = frames_of(model, Change::load_cell, 6.2, 14);
  model.friction.mu.value = 0.65;  // declared; the rig has 0.8
  ModelVerdict verdict = alarm();
  verdict.reference_mu = 0.8;
  const auto found = explanations_of(model, test::period_s, frames, verdict);
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found.front().relation, Relation::load_cell) << found.front().words;
}

TEST(ExplanationTest, ExplainsNothingWithoutAChange) {
  const physics::Model model = test::paper_rig(Law::coulomb);
  const auto found =
      explanations_of(model, test::period_s, frames_of(model, Change::none, 6.2, 15), alarm());
  ASSERT_FALSE(found.empty());
  EXPECT_LT(found.front().log_likelihood, 0.0) << found.front().words;
}

TEST(ExplanationTest, ProbabilitiesSumToOneInDescendingOrder) {
  const physics::Model model = test::paper_rig(Law::coulomb);
  const auto found =
      explanations_of(model, test::period_s, frames_of(model, Change::bristle, 5.0, 16), alarm());
  double sum = 0.0;
  double before = 1.0;
  for (const Explanation& e : found) {
    EXPECT_LE(e.probability, before);
    before = e.probability;
    sum += e.probability;
  }
  EXPECT_NEAR(sum, 1.0, 1.0e-9);
}

// Sensor errors of the model still hold: a limit is unchanged, a known gain is multiplied.
TEST(ExplanationTest, FindsAGainInAdditionToKnownSensorErrors) {
  const physics::Model rig = test::paper_rig(Law::coulomb);
  auto frames = frames_of(rig, Change::none, 6.2, 19);
  physics::Model believed = rig;
  believed.terms = {{"clipping", Channel::velocity, {{"limit", {0.1}}}},
                    {"gain_error", Channel::velocity, {{"gain", {0.8}}}}};
  for (Frame& frame : frames) {
    const double gain = frame.time_s() < change_s ? 0.8 : 0.8 * 1.2;
    frame.set(Channel::velocity, std::clamp(gain * frame[Channel::velocity], -0.1, 0.1));
  }
  const auto found = explanations_of(believed, test::period_s, frames, alarm());
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found.front().words, "the channel velocity reads 1.2 times what it did");
  EXPECT_GT(found.front().probability, 0.99);
}

TEST(ExplanationTest, CannotDistinguishAnUnmeasuredLoadFromMu) {
  const physics::Model model = test::paper_rig(Law::coulomb);
  auto frames = frames_of(model, Change::mu_up, 6.2, 17);
  for (Frame& frame : frames) frame.invalidate(Channel::normal_load);
  const auto found = explanations_of(model, test::period_s, frames, alarm());
  ASSERT_GE(found.size(), 2U);
  EXPECT_LT(found[0].probability, 0.9) << found[0].words;
  EXPECT_GT(found[1].probability, 0.1) << found[1].words;
}

TEST(ExplanationTest, IsEmptyWithoutEnoughFramesOrASupportedModel) {
  physics::Model model = test::paper_rig(Law::coulomb);
  const auto frames = frames_of(model, Change::mu_up, 3.0, 18);
  EXPECT_TRUE(explanations_of(model, test::period_s, frames, alarm()).empty());
  EXPECT_TRUE(explanations_of(model, test::period_s, {}, alarm()).empty());
  model.sensors[index_of(Channel::displacement)].filters.assign(
      6, {physics::FilterKind::butterworth_lowpass, 8, 25.0});  // more states than supported
  const auto enough = frames_of(test::paper_rig(Law::coulomb), Change::mu_up, 6.0, 18);
  EXPECT_TRUE(explanations_of(model, test::period_s, enough, alarm()).empty());
}

}  // namespace
}  // namespace stickslip::observer
