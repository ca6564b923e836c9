// SPDX-License-Identifier: Apache-2.0
// The reference simulator against closed-form solutions and against physics::RigSimulator, with
// which it shares no code.
#include "tools/concealment/reference_simulator.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "physics/simulator.h"

namespace stickslip::concealment {
namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;

ReferenceRig frictionless() {
  ReferenceRig n;
  n.excitation = physics::Excitation::force;
  n.loaded = false;
  n.friction = false;
  n.mass_kg = 0.06;
  n.stiffness_n_m = 14.0;
  n.damping_n_s_m = 0.05;
  n.drive = {Tone{0.02, 2.0, 0.0, {}}};
  n.instrument[index_of(Channel::displacement)].recorded = true;
  return n;
}

TEST(Motion, DerivativesMatchDifferences) {
  Tone tone{0.01, 3.0, 0.4, {}};
  tone.envelope = {{{0.3, 0.11, 1.0}, {0.2, 0.2, 2.0}, {0.1, 0.31, 0.0}}};
  const double t = 1.7;
  const double h = 1.0e-5;
  const auto at = [&](double time) { return motion_of({tone}, time); };
  EXPECT_NEAR(at(t).first, (at(t + h).value - at(t - h).value) / (2.0 * h), 1.0e-8);
  EXPECT_NEAR(at(t).second, (at(t + h).first - at(t - h).first) / (2.0 * h), 1.0e-6);
}

TEST(ReferenceSimulator, LinearRigFollowsItsResonanceCurve) {
  const ReferenceRig n = frictionless();
  ReferenceSimulator run(n, 30.0);
  const double w = two_pi * 2.0;
  const double expected =
      0.02 / std::hypot(n.stiffness_n_m - n.mass_kg * w * w, n.damping_n_s_m * w);
  double largest = 0.0;
  for (int k = 1; k <= 2000; ++k) {
    run.advance(k * 0.5e-3);
    largest = std::max(largest, run.read()[index_of(Channel::displacement)]);
  }
  EXPECT_NEAR(largest / expected, 1.0, 1.0e-3);
}

TEST(ReferenceSimulator, SetValuedFrictionSticksBelowBreakAway) {
  ReferenceRig n = frictionless();
  n.friction = true;
  n.mu = 0.03;  // newtons, above the drive's 0.02
  ReferenceSimulator held(n, 5.0);
  for (int k = 1; k <= 1000; ++k) {
    held.advance(k * 1.0e-3);
    ASSERT_NEAR(held.read()[index_of(Channel::displacement)], 0.0, 1.0e-20);
  }
  EXPECT_EQ(held.slip_share(), 0.0);
  n.mu = 0.005;
  ReferenceSimulator moved(n, 5.0);
  moved.advance(2.0);
  EXPECT_GT(moved.slip_share(), 0.3);
}

// A wedge-loaded rig with state-variable friction and a resonant load cell, for both simulators.
struct SameRig {
  physics::Model model;
  ReferenceRig reference;
};

physics::Model wedge_model() {
  physics::Model model;
  model.oscillator.mass_kg = {0.06};
  model.oscillator.natural_frequency_hz = physics::Parameter{2.4};
  model.oscillator.damping_ratio = physics::Parameter{0.015};
  model.normal_load = physics::NormalLoad{physics::NormalLoadLaw::wedge, {0.2}, {30.0}};
  model.friction.law = physics::FrictionLaw::state_variable;
  model.friction.mu = {0.5};
  model.friction.transition_speed_m_s = {0.003};
  model.friction.rate_per_s = {150.0};
  model.load_cell =
      physics::LoadCell{{0.0126}, {19.3}, {0.016}, physics::LoadCellDynamics::resonant};
  return model;
}

ReferenceRig wedge_reference() {
  ReferenceRig n;
  n.drive = {Tone{0.006, 3.0, 0.0, {}}};
  n.mass_kg = 0.06;
  const double w0 = two_pi * 2.4;
  n.stiffness_n_m = 0.06 * w0 * w0;
  n.damping_n_s_m = 2.0 * 0.015 * 0.06 * w0;
  n.load_n = 0.2;
  n.load_slope_per_m = 30.0;
  n.mu = 0.5;
  n.transition_speed_m_s = 0.003;
  n.relaxation_per_s = 150.0;
  n.cell = n.cell_rings = true;
  n.cell_mass_kg = 0.0126;
  n.cell_frequency_hz = 19.3;
  n.cell_damping_ratio = 0.016;
  return n;
}

SameRig wedge_rig() {
  SameRig rig{wedge_model(), wedge_reference()};
  for (const Channel channel : {Channel::displacement, Channel::velocity, Channel::friction_force,
                                Channel::normal_load, Channel::base_displacement}) {
    std::vector<physics::Filter> filters = {{physics::FilterKind::butterworth_lowpass, 4, 25.0}};
    if (channel == Channel::velocity) {
      filters = {{physics::FilterKind::first_order_lowpass, 1, 150.0}};
    }
    rig.reference.instrument[index_of(channel)].recorded = true;
    rig.reference.instrument[index_of(channel)].filters = filters;
    rig.model.sensors[index_of(channel)].filters = filters;
  }
  return rig;
}

// The states that an estimator is compared with.
using TrueStates = std::array<double, 6>;
TrueStates states_of(const physics::RigTruth& t) {
  return {t.displacement_m, t.velocity_m_s,     t.slip_velocity_m_s,
          t.theta,          t.friction_force_n, t.normal_load_n};
}

TEST(ReferenceSimulator, AgreesWithTheSimulatorOfPhysics) {
  const SameRig rig = wedge_rig();
  // No warm-up: RigSimulator starts at time 0.
  ReferenceSimulator run(rig.reference, 0.0);
  physics::SimulationOptions options;
  options.step_s = 2.0e-5;
  options.noise = false;
  physics::RigSimulator simulator(rig.model, options);
  const auto input_at = [&](double t) {
    const Motion m = motion_of(rig.reference.drive, t);
    physics::Input input;
    input.base_displacement_m = m.value;
    input.base_acceleration_m_s2 = m.second;
    return input;
  };
  simulator.set_input(input_at(0.0));
  std::array<double, channel_count> square{};
  std::array<double, channel_count> error{};
  TrueStates state_square{};
  TrueStates state_error{};
  for (int k = 1; k <= 6000; ++k) {
    const double t = k * 5.0e-4;
    simulator.advance(5.0e-4, input_at(t));
    run.advance(t);
    if (t < 0.5) continue;  // different initial states of the filters
    const Frame frame = simulator.read();
    const auto readings = run.read();
    for (std::size_t c = 0; c < 5; ++c) {
      square[c] += frame.value[c] * frame.value[c];
      error[c] += std::pow(frame.value[c] - readings[c], 2);
    }
    const TrueStates expected = states_of(simulator.truth());
    const TrueStates states = states_of(run.truth());
    for (std::size_t i = 0; i < states.size(); ++i) {
      state_square[i] += expected[i] * expected[i];
      state_error[i] += std::pow(expected[i] - states[i], 2);
    }
  }
  for (std::size_t i = 0; i < state_square.size(); ++i) {
    EXPECT_GT(state_square[i], 0.0) << i;
    EXPECT_LT(std::sqrt(state_error[i] / state_square[i]), 1.0e-2) << "state " << i;
  }
  for (std::size_t c = 0; c < 5; ++c) {
    EXPECT_LT(std::sqrt(error[c] / square[c]), 5.0e-3) << channel_table[c].stem;
  }
}

// Sliding to and fro at 5 mm, whatever the friction; break-away after a tenth of a millimetre.
ReferenceRig rubbed_bristle() {
  ReferenceRig n;
  n.excitation = physics::Excitation::imposed;
  n.loaded = false;
  n.mu = 0.1;
  n.bristle_n_m = 1000.0;
  n.bristle_n_s_m = 0.01;
  n.drive = {Tone{0.005, 1.0, 0.0, {}}};
  n.instrument[index_of(Channel::friction_force)].recorded = true;
  return n;
}

TEST(ReferenceSimulator, EveryBristleSlipsAtTheFrictionLevel) {
  std::vector<ReferenceRig> rigs(4, rubbed_bristle());
  rigs[0].bristle_elastic_share = 0.5;
  rigs[1].dahl_exponent = 0.7;
  rigs[2].dahl_exponent = 2.0;
  rigs[3].dahl_exponent = 1.0;
  rigs[3].bristle_damping_speed_m_s = 0.005;
  for (const ReferenceRig& rig : rigs) {
    ReferenceSimulator run(rig, 2.0);
    run.advance(0.2);
    EXPECT_NEAR(run.read()[index_of(Channel::friction_force)], 0.1, 2.0e-3) << rig.dahl_exponent;
    run.advance(0.7);
    EXPECT_NEAR(run.read()[index_of(Channel::friction_force)], -0.1, 2.0e-3) << rig.dahl_exponent;
  }
}

TEST(ReferenceSimulator, RelaxationProcessesHaveTheMeanLagOfOne) {
  ReferenceRig one = rubbed_bristle();
  one.bristle_n_m = 0.0;
  one.transition_speed_m_s = 0.1;  // nearly viscous: a lag is a shift in time
  one.relaxation_per_s = 200.0;
  ReferenceRig two = one;
  two.relaxation_share = 0.4;
  two.relaxation_ratio = 4.0;
  ReferenceSimulator a(one, 2.0);
  ReferenceSimulator b(two, 2.0);
  a.advance(0.25);
  b.advance(0.25);
  const std::size_t f = index_of(Channel::friction_force);
  EXPECT_NEAR(a.read()[f], b.read()[f], 3.0e-4 * one.mu);
}

TEST(Wander, IsLinearBetweenItsKnots) {
  const Wander wander{0.5, {1.0, 2.0, 0.0}};
  EXPECT_EQ(wander.at(-1.0), 1.0);
  EXPECT_EQ(wander.at(0.25), 1.5);
  EXPECT_EQ(wander.at(0.75), 1.0);
  EXPECT_EQ(wander.at(9.0), 0.0);
  EXPECT_EQ(Wander{}.at(1.0), 0.0);
}

TEST(ReferenceSimulator, SensorErrors) {
  ReferenceRig n = frictionless();
  const std::size_t x = index_of(Channel::displacement);
  const auto reading_at = [&](const ReferenceRig& nature, double t) {
    ReferenceSimulator run(nature, 10.0);
    run.advance(t);
    return run.read()[x];
  };
  const double plain = reading_at(n, 0.3);
  ReferenceRig faulty = n;
  faulty.instrument[x].gain = 1.1;
  EXPECT_NEAR(reading_at(faulty, 0.3), 1.1 * plain, 1.0e-12);
  faulty = n;
  faulty.instrument[x].drift_per_s = 1.0e-3;
  EXPECT_NEAR(reading_at(faulty, 0.3), plain + 3.0e-4, 1.0e-9);
  faulty = n;
  faulty.instrument[x].delay_s = 0.01;
  EXPECT_NEAR(reading_at(faulty, 0.3), reading_at(n, 0.29), 1.0e-7);
  faulty.instrument[x].bessel_delay = true;
  EXPECT_NEAR(reading_at(faulty, 0.3), reading_at(n, 0.29), 2.0e-3 * std::abs(plain) + 2.0e-5);
  faulty = n;
  faulty.instrument[x].limit = 1.0e-4;
  EXPECT_LE(std::abs(reading_at(faulty, 0.3)), 1.0e-4);
}

}  // namespace
}  // namespace stickslip::concealment
