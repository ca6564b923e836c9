// SPDX-License-Identifier: Apache-2.0
#include "tools/investigation/questions.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "config/model_file.h"
#include "physics/simulator.h"

namespace stickslip::investigation {
namespace {

using diagnosis::OpenHypothesis;

constexpr double displacement_limit_m = 0.02;

physics::Model believed() {
  return config::load_model(STICKSLIP_SOURCE_DIR "/config/models/simulated.toml");
}

physics::Model with(const char* id, std::map<std::string, physics::Parameter> parameters) {
  physics::Model out = believed();
  out.terms.push_back({id, {}, std::move(parameters)});
  return out;
}

Study study() {
  Study out;
  out.facts.rate_hz = 500.0;
  out.facts.limits = {0.012, 0.4, 12.0};
  out.facts.ranges.low[index_of(Channel::displacement)] = -displacement_limit_m;
  out.facts.ranges.high[index_of(Channel::displacement)] = displacement_limit_m;
  out.settings.shortest_s = out.settings.longest_s = 6.0;
  out.settings.evaluations = 12;
  return out;
}

// The largest values of the truth's own motion and of the base under it, in steps that the design
// does not take.
struct TrueMotion {
  double displacement_m = 0.0;
  design::DrivePeaks base;
};

TrueMotion motion_under(const design::Drive& drive, const physics::Model& truth) {
  constexpr int parts = 8;
  physics::RigSimulator rig(truth, {.step_s = drive.period_s / parts, .noise = false});
  TrueMotion out;
  out.base = design::peaks_of(drive);
  for (std::size_t k = 1; k < drive.samples.size(); ++k) {
    for (int part = 1; part <= parts; ++part) {
      const double share = static_cast<double>(part) / parts;
      physics::Input input;
      input.base_displacement_m = std::lerp(drive.samples[k - 1], drive.samples[k], share);
      input.base_acceleration_m_s2 =
          std::lerp(second_derivative(drive, k - 1), second_derivative(drive, k), share);
      rig.advance(drive.period_s / parts, input);
      out.displacement_m = std::max(out.displacement_m, std::abs(rig.truth().displacement_m));
    }
  }
  return out;
}

// The declared model does not know the truth's spring, its hardening, or that it is 30 % off.
void expect_within_limits(const NextRun& run, const std::vector<physics::Model>& truths) {
  const Study asked = study();
  for (const physics::Model& truth : truths) {
    for (const double factor : {0.7, 0.85, 1.0, 1.3}) {
      const TrueMotion motion = motion_under(run.drive, design::with_stiffness(truth, factor));
      EXPECT_LE(motion.displacement_m, displacement_limit_m)
          << run.question.words << ", stiffness by " << factor;
      EXPECT_LE(motion.base.value, asked.facts.limits.value) << run.question.words;
      EXPECT_LE(motion.base.first, asked.facts.limits.first) << run.question.words;
      EXPECT_LE(motion.base.second, asked.facts.limits.second) << run.question.words;
    }
  }
}

std::vector<physics::Model> possible_truths() {
  return {believed(), with("cubic_stiffness", {{"k3_n_m3", {7000.0, 0.0}}}),
          with("quadratic_drag", {{"drag_n_s2_m2", {0.3, 0.0}}})};
}

TEST(Questions, TheFirstRunKeepsATruthThatIsFarOffWithinTheLimits) {
  const auto run = first_run(study(), believed(), {});
  ASSERT_TRUE(run);
  EXPECT_TRUE(run->question.expected.empty());
  expect_within_limits(*run, possible_truths());
}

TEST(Questions, TheNextRunDoesAndSeparatesTheHypothesesThatAreLeft) {
  Study asked = study();
  const auto first = first_run(asked, believed(), {});
  ASSERT_TRUE(first);
  asked.steps.emplace_back().question = first->question;
  diagnosis::Diagnosis result;
  result.horizon_s = 0.5;
  for (const Channel channel : {Channel::displacement, Channel::velocity}) {
    result.noise_std.emplace_back(channel, 2.0e-4);
  }
  const std::vector<physics::Model> truths = possible_truths();
  result.open_hypotheses = {{"cubic_stiffness", "cubic_stiffness", "", 0.6, {truths[1]}},
                            {"quadratic_drag", "quadratic_drag", "", 0.4, {truths[2]}}};
  for (OpenHypothesis& each : result.open_hypotheses) {
    physics::Model drawn = each.models.front();
    drawn.terms.front().parameters.begin()->second.value *= 1.1;
    each.models.push_back(drawn);
  }
  const auto run = next_run(asked, 1, result, {});
  ASSERT_TRUE(run);
  EXPECT_GT(run->question.gain, 0.0);
  EXPECT_EQ(run->question.expected.size(), 2U);
  expect_within_limits(*run, truths);
}

// With one hypothesis there is nothing to separate: another kind of run is made.
TEST(Questions, WithOneHypothesisTheNextRunIsOfAnotherKind) {
  Study asked = study();
  const auto first = first_run(asked, believed(), {});
  ASSERT_TRUE(first);
  asked.steps.emplace_back().question = first->question;
  diagnosis::Diagnosis result;
  result.open_hypotheses = {{"nothing", "nothing is missing", "", 1.0, {believed()}}};
  const auto run = next_run(asked, 1, result, {});
  ASSERT_TRUE(run);
  EXPECT_NE(run->question.plan.family, first->question.plan.family);
}

TEST(Questions, UsualRunsFollowInTheirOrder) {
  Study asked = study();
  asked.settings.usual_runs = true;
  diagnosis::Diagnosis result;
  result.open_hypotheses = {{"nothing", "nothing is missing", "", 0.6, {believed()}},
                            {"quadratic_drag", "quadratic_drag", "", 0.4, {possible_truths()[2]}}};
  const std::span<const design::RunPlan> usual = design::usual_runs();
  asked.steps.emplace_back().question.plan = usual[0];
  for (std::size_t i = 1; i < 3; ++i) {
    const auto run = next_run(asked, i, result, {});
    ASSERT_TRUE(run);
    EXPECT_EQ(run->question.plan.family, usual[i].family);
    EXPECT_EQ(run->question.plan.shape, usual[i].shape);
    asked.steps.emplace_back().question = run->question;
  }
}

}  // namespace
}  // namespace stickslip::investigation
