// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/balances.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "diagnosis/balance_signature.h"
#include "diagnosis/instruments.h"
#include "physics/simulator.h"
#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using physics::Model;
using physics::Parameter;
using physics::Relation;
using std::numbers::pi;

// A base-excited mass with dry friction, five channels behind analogue filters, and instruments of
// which nothing is declared.
Model rubbing_mass() {
  Model model;
  model.oscillator.mass_kg = {0.060, 0.0006};
  model.oscillator.natural_frequency_hz = Parameter{2.40, 0.05};
  model.oscillator.damping_ratio = Parameter{0.015, 0.005};
  model.normal_load = {physics::NormalLoadLaw::constant, {0.15, 0.01}, {}};
  model.friction = {physics::FrictionLaw::coulomb, {0.8, 0.1}, {0.0025}, {}};
  const auto set = [&model](Channel channel, double noise_std, double cutoff_hz) {
    physics::Sensor& sensor = model.sensors[index_of(channel)];
    sensor.noise_std = noise_std;
    physics::Filter filter;
    filter.cutoff_hz = {cutoff_hz};
    sensor.filters = {filter};
  };
  set(Channel::displacement, 5.0e-5, 25.0);
  set(Channel::velocity, 1.0e-3, 150.0);
  set(Channel::friction_force, 1.0e-3, 50.0);
  set(Channel::normal_load, 5.0e-4, 50.0);
  set(Channel::base_displacement, 5.0e-5, 25.0);
  return model;
}

// Two tones of the base, or of an imposed motion.
physics::Input drive_at(double time_s) {
  physics::Input input;
  for (const auto& [hz, amplitude_m] : {std::pair{2.2, 0.010}, std::pair{2.9, 0.006}}) {
    const double w = 2.0 * pi * hz;
    input.base_displacement_m += amplitude_m * std::sin(w * time_s);
    input.base_acceleration_m_s2 -= amplitude_m * w * w * std::sin(w * time_s);
    input.velocity_m_s += amplitude_m * w * std::cos(w * time_s);
  }
  input.displacement_m = input.base_displacement_m;
  return input;
}

constexpr double sampled_hz = 500.0;

protocol::Recording recorded(const Model& truth, std::uint64_t seed = 1) {
  physics::SimulationOptions options;
  options.seed = seed;
  options.step_s = 5.0e-4;
  physics::RigSimulator rig(truth, options);
  rig.set_input(drive_at(0.0));
  protocol::Recording out;
  out.source = "bench.csv";
  for (int k = 0; k < 10000; ++k) {
    for (int part = 1; k > 0 && part <= 4; ++part) {
      rig.advance(0.25 / sampled_hz, drive_at((k - 1 + 0.25 * part) / sampled_hz));
    }
    Frame frame = rig.read();
    frame.time_ns = k * static_cast<std::int64_t>(1.0e9 / sampled_hz);
    out.channels |= frame.valid;
    out.frames.push_back(frame);
  }
  return out;
}

Balances balances_against(const Model& declared, const protocol::Recording& recording,
                          std::uint64_t seed = 1) {
  const std::vector<Experiment> experiments = {make_experiment(recording, declared)};
  const Model model = with_instruments(declared, experiments.front());
  return balances_of({{&recording, 1}, experiments, model, model}, seed, 1);
}

double excess(const Balances& balances, Balance balance) { return balances[balance]->excess; }

TEST(Balances, OfARecordingThatHidesNothingAreNoiseAlone) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const Balances found = balances_against(rubbing_mass(), recorded(rubbing_mass(), seed), seed);
    for (const Balance each : all_balances) {
      SCOPED_TRACE(name_of(each));
      ASSERT_TRUE(found[each].has_value());
      EXPECT_NEAR(found[each]->excess, 1.0, 0.12);
      EXPECT_GT(found[each]->p, 1.0e-3);
    }
    EXPECT_FALSE(location_by(found, rubbing_mass()).has_value());
  }
}

TEST(Balances, OfAHardeningSpringFailInTheForceBalanceAlone) {
  const Model truth = test::with_term(rubbing_mass(), "cubic_stiffness", {{"k3_n_m3", {2.0e3}}});
  const Balances found = balances_against(rubbing_mass(), recorded(truth));
  EXPECT_GT(excess(found, Balance::force_balance), 3.0);
  EXPECT_LT(found[Balance::force_balance]->p, 1.0e-6);
  EXPECT_LT(excess(found, Balance::kinematics), 1.3);
  EXPECT_LT(excess(found, Balance::friction_law), 1.3);
  EXPECT_LT(excess(found, Balance::normal_load), 1.3);
  const auto location = location_by(found, rubbing_mass());
  ASSERT_TRUE(location.has_value());
  EXPECT_EQ(location->relation, Relation::force_balance);
}

TEST(Balances, OfOtherFrictionFailInItsLawAlone) {
  for (const auto& truth :
       {test::with_term(rubbing_mass(), "stribeck",
                        {{"static_ratio", {1.4}}, {"stribeck_speed_m_s", {0.05}}}),
        test::with_term(rubbing_mass(), "asymmetric_friction", {{"asymmetry", {0.15}}})}) {
    SCOPED_TRACE(truth.terms.front().id);
    const Balances found = balances_against(rubbing_mass(), recorded(truth));
    EXPECT_GT(excess(found, Balance::friction_law), 2.0);
    EXPECT_LT(found[Balance::friction_law]->p, 1.0e-6);
    EXPECT_LT(excess(found, Balance::force_balance), 1.3);
    const auto location = location_by(found, rubbing_mass());
    ASSERT_TRUE(location.has_value());
    EXPECT_EQ(location->relation, Relation::friction_law);
  }
}

TEST(Balances, OfALateFrictionChannelFailInForceAndFrictionAlike) {
  Model truth = rubbing_mass();
  truth.sensors[index_of(Channel::friction_force)].delay_s = Parameter{0.010};
  const Balances found = balances_against(rubbing_mass(), recorded(truth));
  EXPECT_GT(excess(found, Balance::force_balance), 1.5);
  EXPECT_GT(excess(found, Balance::friction_law), 1.5);
  ASSERT_TRUE(found.force_and_friction.has_value());
  EXPECT_GT(*found.force_and_friction, 0.8);
  const auto location = location_by(found, rubbing_mass());
  ASSERT_TRUE(location.has_value());
  EXPECT_EQ(location->relation, Relation::sensor);
  EXPECT_EQ(location->channel, Channel::friction_force);
}

TEST(Balances, OfAVelocityOfAnotherGainFailInTheKinematics) {
  Model truth = rubbing_mass();
  truth.sensors[index_of(Channel::velocity)].gain = Parameter{1.08};
  const Balances found = balances_against(rubbing_mass(), recorded(truth));
  EXPECT_GT(excess(found, Balance::kinematics), 3.0);
  EXPECT_LT(excess(found, Balance::force_balance), 1.3);
  EXPECT_LT(excess(found, Balance::friction_law), 1.3);
  const auto location = location_by(found, rubbing_mass());
  ASSERT_TRUE(location.has_value());
  EXPECT_EQ(location->relation, Relation::kinematics);
  EXPECT_EQ(location->channel, Channel::velocity);
}

TEST(Balances, OfADisplacementOfAnotherGainFailInKinematicsAndForce) {
  Model truth = rubbing_mass();
  truth.sensors[index_of(Channel::displacement)].gain = Parameter{1.08};
  const Balances found = balances_against(rubbing_mass(), recorded(truth));
  EXPECT_GT(excess(found, Balance::kinematics), 3.0);
  EXPECT_GT(excess(found, Balance::force_balance), 1.3);
  const auto location = location_by(found, rubbing_mass());
  ASSERT_TRUE(location.has_value());
  EXPECT_EQ(location->channel, Channel::displacement);
}

TEST(Balances, OfAnInclinedTrackFailInTheNormalLoadAlone) {
  const Model truth = test::with_term(rubbing_mass(), "wedge_load", {{"slope_per_m", {5.0}}});
  const Balances found = balances_against(rubbing_mass(), recorded(truth));
  EXPECT_GT(excess(found, Balance::normal_load), 3.0);
  EXPECT_LT(excess(found, Balance::friction_law), 1.3);
  const auto location = location_by(found, rubbing_mass());
  ASSERT_TRUE(location.has_value());
  EXPECT_EQ(location->relation, Relation::normal_load);
}

// Slow noise beside the white one that is declared.
TEST(Balances, OfADriveWithOtherNoiseFailInTheExcitation) {
  protocol::Recording recording = recorded(rubbing_mass());
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  const double kept = std::exp(-1.0 / (0.02 * sampled_hz));
  double slow_m = 0.0;
  for (Frame& frame : recording.frames) {
    slow_m = kept * slow_m + 4.0e-5 * std::sqrt(1.0 - kept * kept) * normal(random);
    frame.set(Channel::base_displacement, frame[Channel::base_displacement] + slow_m);
  }
  const Balances found = balances_against(rubbing_mass(), recording);
  EXPECT_GT(excess(found, Balance::excitation), 1.2);
  EXPECT_LT(found[Balance::excitation]->p, 1.0e-3);
  EXPECT_NEAR(excess(found, Balance::kinematics), 1.0, 0.12);
}

TEST(Balances, OfWhatWasNotMeasuredAreAbsent) {
  protocol::Recording recording = recorded(rubbing_mass());
  for (Frame& frame : recording.frames) {
    frame.invalidate(Channel::velocity);
    frame.invalidate(Channel::friction_force);
    frame.invalidate(Channel::normal_load);
  }
  recording.channels = static_cast<std::uint8_t>((1U << index_of(Channel::displacement)) |
                                                 (1U << index_of(Channel::base_displacement)));
  const Balances found = balances_against(rubbing_mass(), recording);
  EXPECT_FALSE(found[Balance::kinematics].has_value());
  EXPECT_FALSE(found[Balance::friction_law].has_value());
  EXPECT_FALSE(found[Balance::normal_load].has_value());
  ASSERT_TRUE(found[Balance::force_balance].has_value());
  EXPECT_NEAR(excess(found, Balance::force_balance), 1.0, 0.15);
}

TEST(Balances, OfAnImposedMotionHaveNoForce) {
  Model imposed = rubbing_mass();
  imposed.oscillator = {};
  imposed.oscillator.excitation = physics::Excitation::imposed;
  const Balances found = balances_against(imposed, recorded(imposed));
  EXPECT_FALSE(found[Balance::force_balance].has_value());
  EXPECT_FALSE(found[Balance::excitation].has_value());
  ASSERT_TRUE(found[Balance::friction_law].has_value());
  EXPECT_NEAR(excess(found, Balance::friction_law), 1.0, 0.15);
}

TEST(Balances, DoNotDependOnTheNumberOfThreads) {
  const protocol::Recording recording = recorded(rubbing_mass());
  const std::vector<Experiment> experiments = {make_experiment(recording, rubbing_mass())};
  const Model model = with_instruments(rubbing_mass(), experiments.front());
  const BalanceCase measured{{&recording, 1}, experiments, model, model};
  const Balances one = balances_of(measured, 1, 1);
  const Balances three = balances_of(measured, 1, 3);
  for (const Balance each : all_balances) EXPECT_EQ(one[each]->excess, three[each]->excess);
}

Balances with_departures(std::initializer_list<std::pair<Balance, double>> excesses) {
  Balances out;
  for (const Balance each : all_balances) out.of[index_of(each)] = BalanceResidual{1.0, 0.5};
  for (const auto& [balance, value] : excesses) {
    out.of[index_of(balance)] = BalanceResidual{value, 1.0e-9};
  }
  return out;
}

TEST(BalanceSignature, DistinguishesTheChannelOfTheLoadFromItsLaw) {
  const Model model = rubbing_mass();
  const auto law = location_by(with_departures({{Balance::normal_load, 20.0}}), model);
  EXPECT_EQ(law->relation, Relation::normal_load);
  const auto channel = location_by(
      with_departures({{Balance::normal_load, 20.0}, {Balance::friction_law, 15.0}}), model);
  EXPECT_EQ(channel->relation, Relation::sensor);
  EXPECT_EQ(channel->channel, Channel::normal_load);
}

// A second mode moves both, against each other.
TEST(BalanceSignature, TakesOppositeForceAndFrictionForTheirLargerOne) {
  Balances balances =
      with_departures({{Balance::force_balance, 9.0}, {Balance::friction_law, 5.0}});
  balances.force_and_friction = -0.4;
  EXPECT_EQ(location_by(balances, rubbing_mass())->relation, Relation::force_balance);
}

TEST(BalanceSignature, DoesNotTakeADriveForTheRig) {
  EXPECT_FALSE(
      location_by(with_departures({{Balance::excitation, 30.0}}), rubbing_mass()).has_value());
}

TEST(BalanceSignature, AdmitsTheLawOfFrictionThatNoChannelMeasures) {
  Balances balances = with_departures({{Balance::force_balance, 9.0}});
  const auto location = location_by(balances, rubbing_mass());
  EXPECT_FALSE(admits(*location, balances, Relation::friction_law, std::nullopt));
  balances.of[index_of(Balance::friction_law)].reset();
  EXPECT_TRUE(admits(*location, balances, Relation::friction_law, std::nullopt));
}

}  // namespace
}  // namespace stickslip::diagnosis
