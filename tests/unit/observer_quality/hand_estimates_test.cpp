// SPDX-License-Identifier: Apache-2.0
#include "tests/benchmark/hand_estimates.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "physics/sensor_chain.h"

namespace stickslip::quality {
namespace {

constexpr double period_s = 2.0e-3;
constexpr double omega = 2.0 * std::numbers::pi * 2.0;  // of all motion
constexpr double cell_kg = 0.0126;
constexpr double mu = 0.5;
constexpr double load_n = 0.2;
constexpr double friction_n = 0.08;
constexpr double base_m = 0.006;
constexpr double speed_m_s = 0.1;

// A base-excited rig with a quasi-static load cell. Its friction force is a sine, so that the
// readings are known exactly.
physics::Model model_with(std::vector<physics::Filter> filters) {
  physics::Model model;
  model.oscillator.mass_kg = {0.06};
  model.oscillator.natural_frequency_hz = physics::Parameter{2.4};
  model.oscillator.damping_ratio = physics::Parameter{0.015};
  model.normal_load = physics::NormalLoad{physics::NormalLoadLaw::constant, {load_n}, {}};
  model.friction.law = physics::FrictionLaw::coulomb;
  model.friction.mu = {mu};
  model.friction.transition_speed_m_s = {2.0e-3};
  model.load_cell =
      physics::LoadCell{{cell_kg}, {19.3}, {0.016}, physics::LoadCellDynamics::quasi_static};
  for (auto& sensor : model.sensors) sensor.noise_std = 1.0e-9;
  model.sensors[index_of(Channel::friction_force)].filters = std::move(filters);
  return model;
}

struct Measured {
  protocol::Recording recording;
  std::vector<physics::RigTruth> truth;
};

Measured measured(const physics::Model& model) {
  const physics::FilterChain chain(model.sensors[index_of(Channel::friction_force)].filters,
                                   period_s);
  const std::complex<double> response = chain.response(omega / (2.0 * std::numbers::pi));
  Measured out;
  for (std::size_t k = 0; k < 5000; ++k) {
    const double angle = omega * period_s * static_cast<double>(k);
    physics::RigTruth truth;
    truth.displacement_m = -speed_m_s / omega * std::cos(angle);
    truth.velocity_m_s = truth.slip_velocity_m_s = speed_m_s * std::sin(angle);
    truth.friction_force_n = friction_n * std::sin(angle);
    truth.theta = truth.friction_force_n / (mu * load_n);
    truth.normal_load_n = load_n;
    // k_l y = f - m_l b'', through the filters.
    const double amplitude = friction_n + cell_kg * base_m * omega * omega;
    Frame frame;
    frame.time_ns = static_cast<std::int64_t>(k) * 2'000'000;
    frame.sequence = k;
    frame.set(Channel::displacement, truth.displacement_m);
    frame.set(Channel::velocity, truth.velocity_m_s);
    frame.set(Channel::friction_force, amplitude * std::imag(response * std::polar(1.0, angle)));
    frame.set(Channel::base_displacement, base_m * std::sin(angle));
    out.recording.frames.push_back(frame);
    out.truth.push_back(truth);
  }
  return out;
}

TEST(HandEstimates, EquationOneIsExactForPerfectSensors) {
  const physics::Model model = model_with({});
  const Measured run = measured(model);
  const HandEstimates found = estimates_by_hand(run.recording, model, run.truth, 2.0e-3);
  // The causal acceleration of the base lags by a sample.
  EXPECT_LT(found.causal.force.value(), 0.02);
  EXPECT_LT(found.causal.theta.value(), 0.02);
  EXPECT_LT(found.causal.slip.value(), 1.0e-12);
  EXPECT_LT(found.best.force.value(), 1.0e-3);
  EXPECT_LT(found.best.theta.value(), 1.0e-3);
  EXPECT_DOUBLE_EQ(found.best.auc.value(), 1.0);
}

TEST(HandEstimates, OnlyTheBestInvertsTheFilters) {
  const physics::Model model = model_with({{physics::FilterKind::butterworth_lowpass, 4, 25.0}});
  const Measured run = measured(model);
  const HandEstimates found = estimates_by_hand(run.recording, model, run.truth, 2.0e-3);
  // 2 Hz lags by 0.21 rad, for which a low-pass of the base makes up in part.
  EXPECT_GT(found.causal.force.value(), 0.1);
  EXPECT_LT(found.best.force.value(), 2.0e-3);
  EXPECT_LT(found.best.theta.value(), 2.0e-3);
}

TEST(HandEstimates, ForceBalanceWhereFrictionIsNotRecorded) {
  physics::Model model = model_with({});
  Measured run = measured(model);
  const double stiffness = 0.06 * std::pow(2.0 * std::numbers::pi * 2.4, 2);
  const double damping = 2.0 * 0.015 * 0.06 * 2.0 * std::numbers::pi * 2.4;
  for (std::size_t k = 0; k < run.truth.size(); ++k) {
    run.recording.frames[k].invalidate(Channel::friction_force);
    physics::RigTruth& truth = run.truth[k];
    const double angle = omega * period_s * static_cast<double>(k);
    truth.friction_force_n = 0.06 * base_m * omega * omega * std::sin(angle) -
                             0.06 * speed_m_s * omega * std::cos(angle) -
                             damping * truth.velocity_m_s - stiffness * truth.displacement_m;
  }
  const HandEstimates found = estimates_by_hand(run.recording, model, run.truth, 2.0e-3);
  EXPECT_LT(found.best.force.value(), 5.0e-3);
  EXPECT_LT(found.causal.force.value(), 0.1);
}

TEST(HandEstimates, AbsentWithoutFriction) {
  physics::Model model = model_with({});
  Measured run = measured(model);
  for (physics::RigTruth& truth : run.truth) truth.friction_force_n = truth.theta = 0.0;
  const HandEstimates found = estimates_by_hand(run.recording, model, run.truth, 2.0e-3);
  EXPECT_FALSE(found.best.force);
  EXPECT_FALSE(found.best.theta);
  EXPECT_TRUE(found.best.slip);
}

}  // namespace
}  // namespace stickslip::quality
