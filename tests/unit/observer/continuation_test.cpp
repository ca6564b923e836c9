// SPDX-License-Identifier: Apache-2.0
// An observer goes on from another one's state, with a changed model of the same rig.
#include "observer/continuation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/unit/observer/bench.h"

namespace stickslip::observer {
namespace {

using physics::Model;
using test::Law;
using test::paper_rig;

constexpr double period_s = 1.0e-3;

Model believed_rig() {
  Model model = paper_rig(Law::state_variable);
  model.friction.mu.sigma = 0.2;
  model.friction.rate_per_s.sigma = 40.0;
  model.normal_load->load_n.sigma = 0.01;
  model.oscillator.mass_kg.sigma = 0.0005;
  return model;
}

Model with_hardening(Model model) {
  model.terms.push_back({"cubic_stiffness", {}, {{"k3_n_m3", {7000.0}}}});
  return model;
}

std::vector<Frame> frames_of(const Model& real, double duration_s) {
  physics::RigSimulator rig(real, {.step_s = 1.25e-4, .seed = 3});
  const test::ModulatedBase base{.depth = 0.3};
  rig.set_input(base(0.0));
  std::vector<Frame> out;
  for (int k = 1; k <= std::lround(duration_s / period_s); ++k) {
    for (int half = 1; half <= 2; ++half) {
      rig.advance(0.5 * period_s, base((k - 1 + 0.5 * half) * period_s));
    }
    out.push_back(rig.read());
  }
  return out;
}

/// An observer with one model, and one with another that goes on from it.
struct Swap {
  Swap(const Model& before_model, const Model& now_model, const std::vector<Frame>& frames)
      : before(before_model, period_s), now(now_model, period_s) {
    for (const Frame& frame : frames) before.update(frame);
    continuation = now.continue_from(before);
  }
  FrictionObserver before;
  FrictionObserver now;
  Continuation continuation;
};

TEST(Continuation, WithTheSameModelNothingChanges) {
  const Model model = believed_rig();
  Model exact = model;  // no considered parameters, whose sensitivities build up again
  exact.oscillator.mass_kg.sigma = 0.0;
  const std::vector<Frame> frames = frames_of(model, 4.0);
  const std::vector<Frame> first(frames.begin(), frames.end() - 200);
  Swap swap(exact, exact, first);
  EXPECT_EQ(swap.continuation.anew, 0);
  EXPECT_TRUE(swap.continuation.settled);
  for (auto frame = frames.end() - 200; frame != frames.end(); ++frame) {
    const FrictionEstimate& before = swap.before.update(*frame);
    const FrictionEstimate& now = swap.now.update(*frame);
    ASSERT_EQ(now.status, before.status);
    ASSERT_EQ(now.theta, before.theta);
    ASSERT_EQ(now.mu, before.mu);
    ASSERT_EQ(now.gamma_per_s, before.gamma_per_s);
    ASSERT_EQ(now.velocity_m_s, before.velocity_m_s);
    ASSERT_EQ(now.friction_force_n, before.friction_force_n);
    ASSERT_EQ(now.covariance, before.covariance);
  }
}

TEST(Continuation, StatesAndTheirUncertaintyAreTakenOverByAMendedModel) {
  const Model believed = believed_rig();
  const Model mended = with_hardening(believed);
  std::vector<Frame> frames = frames_of(mended, 6.0);
  const Frame next = frames.back();
  frames.pop_back();
  Swap swap(believed, mended, frames);
  EXPECT_TRUE(swap.continuation.motion);
  EXPECT_TRUE(swap.continuation.mu);
  EXPECT_TRUE(swap.continuation.gamma);
  EXPECT_TRUE(swap.continuation.load);
  EXPECT_EQ(swap.continuation.anew, 0);
  const FrictionEstimate before = swap.before.latest();
  const FrictionEstimate now = swap.now.update(next);
  EXPECT_EQ(now.status, EstimateStatus::good);
  EXPECT_NEAR(now.mu, before.mu, 0.1 * before.standard_deviation(Quantity::mu));
  EXPECT_NEAR(now.standard_deviation(Quantity::mu), before.standard_deviation(Quantity::mu),
              0.02 * before.standard_deviation(Quantity::mu));
  EXPECT_NEAR(now.gamma_per_s, before.gamma_per_s,
              0.1 * before.standard_deviation(Quantity::gamma));
  EXPECT_NEAR(now.displacement_m, before.displacement_m + period_s * before.velocity_m_s,
              3.0 * before.standard_deviation(Quantity::displacement));
  EXPECT_NEAR(now.normal_load_n, before.normal_load_n,
              0.1 * before.standard_deviation(Quantity::normal_load));
}

TEST(Continuation, TheMendedModelEndsWhatTheOldOneLacked) {
  const Model believed = believed_rig();
  const Model mended = with_hardening(believed);
  const std::vector<Frame> frames = frames_of(mended, 9.0);
  Swap swap(believed, mended, {frames.begin(), frames.end() - 3000});
  const std::uint64_t restarts = swap.before.latest().restarts;
  for (auto frame = frames.end() - 3000; frame != frames.end(); ++frame) {
    swap.before.update(*frame);
    ASSERT_TRUE(swap.now.update(*frame).valid) << frame->sequence;
  }
  EXPECT_EQ(swap.now.latest().restarts, restarts);
  EXPECT_GT(swap.before.latest().restarts, restarts);
  EXPECT_GT(swap.before.latest().nis_mean, 1.5);
  EXPECT_LT(swap.now.latest().nis_mean, 1.15);
}

TEST(Continuation, AParameterThatContradictsTheNewModelStartsAnewFromIt) {
  const Model believed = believed_rig();
  Model mended = believed;
  mended.friction.mu = {1.1, 0.002};
  const std::vector<Frame> frames = frames_of(believed, 6.0);
  const Swap swap(believed, mended, frames);
  EXPECT_FALSE(swap.continuation.mu);
  EXPECT_TRUE(swap.continuation.gamma);
  EXPECT_TRUE(swap.continuation.settled);
  EXPECT_EQ(swap.continuation.anew, 1);
}

TEST(Continuation, StatesThatTheOldModelLacksStartAnewAndSettle) {
  const Model believed = believed_rig();
  Model mended = believed;
  mended.terms.push_back({"hysteresis", {}, {{"stiffness_n_m", {3.0}}, {"slip_force_n", {0.03}}}});
  mended.terms.push_back({"channel_delay", Channel::friction_force, {{"delay_s", {0.006}}}});
  std::vector<Frame> frames = frames_of(believed, 3.0);
  const Frame next = frames.back();
  frames.pop_back();
  Swap swap(believed, mended, frames);
  EXPECT_GE(swap.continuation.anew, 3);  // of the spring, and two for each section of the delay
  EXPECT_TRUE(swap.continuation.mu);
  EXPECT_FALSE(swap.continuation.settled);
  EXPECT_EQ(swap.now.update(next).status, EstimateStatus::settling);
  // And back: what both have is kept.
  FrictionObserver back(believed, period_s);
  EXPECT_EQ(back.continue_from(swap.now).anew, 0);
}

TEST(Continuation, FrictionThatGainsAMemoryKeepsTheta) {
  const Model believed = paper_rig(Law::coulomb);
  const Model mended = paper_rig(Law::state_variable);
  std::vector<Frame> frames = frames_of(mended, 3.0);
  const Frame next = frames.back();
  frames.pop_back();
  Swap swap(believed, mended, frames);
  EXPECT_TRUE(swap.continuation.settled);
  EXPECT_NEAR(swap.now.update(next).theta, swap.before.update(next).theta, 0.15);
}

TEST(Continuation, NothingIsTakenFromAnObserverThatHasNotStarted) {
  const Model model = believed_rig();
  const Swap swap(model, model, {});
  EXPECT_EQ(swap.continuation.kept, 0);
  EXPECT_FALSE(swap.continuation.settled);
}

TEST(Continuation, NoiseThatIsNotDeclaredStaysKnown) {
  Model model = believed_rig();
  for (physics::Sensor& sensor : model.sensors) sensor.noise_std.reset();
  std::vector<Frame> frames = frames_of(believed_rig(), 4.0);
  const Frame next = frames.back();
  frames.pop_back();
  Swap swap(model, with_hardening(model), frames);
  const auto x = index_of(Channel::displacement);
  EXPECT_NEAR(swap.now.update(next).innovation_std[x], swap.before.update(next).innovation_std[x],
              0.02 * swap.before.latest().innovation_std[x]);
}

}  // namespace
}  // namespace stickslip::observer
