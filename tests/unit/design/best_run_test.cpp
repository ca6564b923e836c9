// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/design/best_run.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "diagnosis/shooting.h"
#include "physics/simulator.h"

namespace stickslip::design {
namespace {

using diagnosis::OpenHypothesis;

physics::Model rig() {
  physics::Model out;
  out.oscillator.mass_kg = {1.0, 0.0};
  out.oscillator.natural_frequency_hz = physics::Parameter{2.5};
  out.oscillator.damping_ratio = physics::Parameter{0.05};
  out.friction.law = physics::FrictionLaw::coulomb;
  out.friction.mu = {0.3, 0.0};
  out.friction.transition_speed_m_s = {0.001, 0.0};
  return out;
}

physics::Model with(const char* id, const char* parameter, double value) {
  physics::Model out = rig();
  physics::Term term;
  term.id = id;
  term.parameters[parameter] = {value, 0.0};
  out.terms.push_back(term);
  return out;
}

OpenHypothesis hypothesis(const char* id, const char* parameter, double value, double probability) {
  OpenHypothesis out;
  out.id = out.name = id;
  out.probability = probability;
  for (const double factor : {1.0, 0.9, 1.1}) {
    out.models.push_back(with(id, parameter, factor * value));
  }
  return out;
}

DesignRequest request() {
  DesignRequest out;
  out.hypotheses = {hypothesis("cubic_stiffness", "k3_n_m3", 4.0e4, 0.6),
                    hypothesis("quadratic_drag", "drag_n_s2_m2", 2.0, 0.4)};
  out.range.shortest_s = 6.0;
  out.range.longest_s = 8.0;
  out.range.limits = {0.015, 0.5, 20.0};
  set_frequencies(rig(), 500.0, out.range);
  out.motion.low[index_of(Channel::displacement)] = -0.03;
  out.motion.high[index_of(Channel::displacement)] = 0.03;
  out.separation.rate_hz = 500.0;
  out.separation.most_windows = 5;
  for (const Channel channel :
       {Channel::displacement, Channel::velocity, Channel::friction_force}) {
    out.separation.noise_std[index_of(channel)] = 1.0e-4;
  }
  out.evaluations = 16;
  return out;
}

TEST(BestRun, SeparatesMoreInItsTimeThanTheUsualRunsAndIsTheSameForAnyThreads) {
  DesignRequest asked = request();
  const auto best = best_run(asked);
  ASSERT_TRUE(best.has_value());
  double usual = 0.0;
  for (const RunPlan& run : usual_runs()) {
    if (const auto each = evaluated(asked, run)) usual = std::max(usual, each->rate(3.0));
  }
  EXPECT_GE(best->rate(3.0), usual);
  EXPECT_GT(best->gain, 0.1);
  EXPECT_LE(best->gain, 1.0);
  EXPECT_GE(best->evaluations, 16);
  asked.threads = 2;
  const auto other = best_run(asked);
  ASSERT_TRUE(other.has_value());
  EXPECT_EQ(best->drive.samples, other->drive.samples);
}

// A rig whose stiffness is not what the models say moves within the range, too: by a simulation
// with steps that the design does not take.
TEST(BestRun, KeepsTheMotionOfAWrongRigWithinTheRange) {
  DesignRequest asked = request();
  asked.motion.high[0] = 0.02;
  asked.motion.low[0] = -0.02;
  for (const RunPlan& run : usual_runs()) {
    const auto bounded = evaluated(asked, run);
    ASSERT_TRUE(bounded.has_value());
    for (const double factor : {0.7, 0.77, 0.85, 1.0, 1.15, 1.24, 1.3}) {
      physics::RigSimulator truth(
          with_stiffness(with("cubic_stiffness", "k3_n_m3", 4.3e4), factor));
      const Drive& drive = bounded->drive;
      double largest = 0.0;
      for (std::size_t k = 1; k < drive.samples.size(); ++k) {
        physics::Input input;
        input.base_displacement_m = drive.samples[k];
        input.base_acceleration_m_s2 = second_derivative(drive, k);
        truth.advance(drive.period_s, input);
        largest = std::max(largest, std::abs(truth.truth().displacement_m));
      }
      EXPECT_LE(largest, 0.02) << words_for(run, asked.range, false) << " at " << factor;
    }
  }
}

// Also behind filters, whose states a window does not begin with.
TEST(BestRun, ExpectsNothingOfHypothesesThatPredictTheSame) {
  DesignRequest asked = request();
  for (physics::Model& model : asked.hypotheses[0].models) {
    model.sensors[index_of(Channel::displacement)].filters = {{}};
  }
  asked.hypotheses[1] = asked.hypotheses[0];
  asked.evaluations = 0;
  const auto best = best_run(asked);
  ASSERT_TRUE(best.has_value());
  EXPECT_LT(best->gain, 1.0e-6);
}

// The drive is known by its readings: a constant force and a wrong zero of its sensor are the same
// in any run.
TEST(BestRun, ExpectsNothingBetweenAForceAndAWrongZeroOfTheDrive) {
  constexpr double force_n = 0.4;
  DesignRequest asked = request();
  physics::Model driven = rig();
  driven.oscillator.excitation = physics::Excitation::force;
  physics::Model pushed = driven;
  pushed.terms.push_back({"bias_force", {}, {{"force_n", {force_n, 0.0}}}});
  physics::Model misread = driven;
  misread.terms.push_back({"sensor_offset", Channel::drive_force, {{"offset", {-force_n, 0.0}}}});
  for (std::size_t i = 0; i < 2; ++i) {
    asked.hypotheses[i].models = {i == 0 ? pushed : misread};
  }
  const auto run = evaluated(asked, usual_runs().front());
  ASSERT_TRUE(run.has_value());
  EXPECT_LT(run->gain, 0.05);
}

// Also where the motion is small against the error of the zero, and friction reverses early.
TEST(BestRun, ExpectsLittleBetweenAForceAndAWrongZeroOfTheDisplacement) {
  const double omega = 2.0 * std::numbers::pi * 2.5;
  const double force_n = 0.02;
  DesignRequest asked = request();
  for (OpenHypothesis& each : asked.hypotheses) each.models.resize(1);
  physics::Model forced = with("bias_force", "force_n", force_n);
  physics::Model shifted =
      with("sensor_offset", "offset", force_n / (forced.oscillator.mass_kg.value * omega * omega));
  shifted.terms.front().channel = Channel::displacement;
  for (physics::Model* model : {&forced, &shifted}) {
    model->oscillator.excitation = physics::Excitation::force;
    model->friction.mu = {0.005, 0.0};
  }
  asked.hypotheses[0].models = {forced};
  asked.hypotheses[1].models = {shifted};
  asked.range.limits = {0.5, 20.0, std::numeric_limits<double>::infinity()};
  asked.separation.noise_std.fill(0.0);
  asked.separation.noise_std[index_of(Channel::displacement)] = 1.0e-5;
  for (const double amplitude : {1.0, 0.3, 0.05}) {
    RunPlan run = usual_runs().front();
    run.amplitude = amplitude;
    const auto found = evaluated(asked, run);
    ASSERT_TRUE(found.has_value());
    for (const PairSeparation& pair : found->separations) {
      EXPECT_LT(pair.expected, 4.6) << "at " << amplitude << " of the largest drive";
    }
  }
}

TEST(BestRun, EndsWhenItIsAskedTo) {
  DesignRequest asked = request();
  std::stop_source source;
  source.request_stop();
  asked.stop = source.get_token();
  EXPECT_THROW(best_run(asked), diagnosis::Interrupted);
}

}  // namespace
}  // namespace stickslip::design
