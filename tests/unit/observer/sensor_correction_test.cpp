// SPDX-License-Identifier: Apache-2.0
// Observers whose model contains the rig's sensor errors: about as accurate as with ideal sensors.
#include "observer/sensor_correction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <ostream>
#include <string>

#include "observer/kalman_filter.h"
#include "observer/sensor_error_states.h"
#include "tests/unit/observer/smoothed.h"

namespace stickslip::observer {
namespace {

using test::Law;
using test::paper_rig;
using test::rms;
using test::Sample;
using test::smoothed;

double theta_error(const Sample& m) { return m.estimate.theta - m.truth.theta; }
double velocity_error(const Sample& m) { return m.estimate.velocity_m_s - m.truth.velocity_m_s; }

struct Case {
  std::string name;
  std::vector<physics::Term> terms;
  double error_ratio = 1.15;  ///< largest ratio to the error with ideal sensors
};

void PrintTo(const Case& one, std::ostream* out) { *out << one.name; }

physics::Term sensor_term(std::string id, Channel channel,
                          std::map<std::string, physics::Parameter> parameters,
                          std::optional<Channel> from = {}) {
  return {std::move(id), channel, std::move(parameters), from};
}

physics::Term hum(Channel channel, double amplitude) {
  return sensor_term("mains_hum", channel,
                     {{"frequency_hz", {50.0}}, {"amplitude", {amplitude}}, {"phase_rad", {0.7}}});
}

std::vector<Case> cases() {
  using enum Channel;
  const auto late = [](Channel channel, double by_s) {
    return sensor_term("channel_delay", channel, {{"delay_s", {by_s}}});
  };
  const auto gain = [](Channel channel, double by) {
    return sensor_term("gain_error", channel, {{"gain", {by}}});
  };
  const physics::Term drift = sensor_term("sensor_drift", velocity, {{"rate_per_s", {0.002}}});
  // A delayed channel carries information about the past, so the present is less certain.
  constexpr double with_delay = 1.4;
  return {
      {"WrongGain", {gain(friction_force, 1.3)}},
      {"TwoWrongGains", {gain(displacement, 0.8), gain(base_displacement, 1.2)}},
      {"LateForce", {late(friction_force, 0.006)}, with_delay},
      {"LateDisplacement", {late(displacement, 0.0123)}},
      {"LateVelocity", {late(velocity, 0.0045)}},
      {"LateBase", {late(base_displacement, 0.008)}},
      {"VeryLateVelocity", {late(velocity, 0.03)}, with_delay},
      {"EarlyForce", {late(friction_force, -0.002)}},
      {"EarlyVelocity", {late(velocity, -0.002)}},
      {"SlowDifferentiator", {{"differentiator_lag", {}, {{"cutoff_hz", {12.0}}}}}},
      {"Crosstalk",
       {sensor_term("crosstalk", friction_force, {{"coefficient", {3.0}}}, displacement),
        sensor_term("crosstalk", displacement, {{"coefficient", {0.01}}}, friction_force)}},
      {"CrosstalkWithAGainProductOfOne",
       {sensor_term("crosstalk", friction_force, {{"coefficient", {20.0}}}, displacement),
        sensor_term("crosstalk", displacement, {{"coefficient", {0.05}}}, friction_force)}},
      {"CrosstalkOfADelayedChannel",
       {sensor_term("crosstalk", friction_force, {{"coefficient", {20.0}}}, displacement),
        late(displacement, 0.006)}},
      // Sensor errors of the source after its chain are not part of the crosstalk.
      {"CrosstalkOfAChannelWithHumAndDrift",
       {sensor_term("crosstalk", friction_force, {{"coefficient", {20.0}}}, displacement),
        hum(displacement, 0.0005),
        sensor_term("sensor_drift", displacement, {{"rate_per_s", {0.0002}}})}},
      {"CurvedBridge",
       {sensor_term("bridge_nonlinearity", friction_force, {{"curvature", {1.5}}})}},
      {"Drift", {drift}},
      {"Hum", {hum(friction_force, 0.02)}},
      {"Clipped", {sensor_term("clipping", velocity, {{"limit", {0.1}}})}},
      {"DelayGainAndDrift",
       {late(friction_force, 0.006), gain(friction_force, 0.7), drift},
       with_delay},
  };
}

class SensorErrors : public testing::TestWithParam<Case> {};

TEST_P(SensorErrors, InTheModelAreCompensated) {
  const physics::Model ideal = paper_rig(Law::state_variable);
  physics::Model faulty = ideal;
  faulty.terms = GetParam().terms;
  const test::RunOptions options{.duration_s = 8.0};
  const auto reference = test::run_observer(ideal, ideal, options);
  const auto corrected = test::run_observer(faulty, faulty, options);
  EXPECT_EQ(corrected.back().estimate.restarts, 0U);
  for (const auto& error : {theta_error, velocity_error}) {
    EXPECT_LT(rms(corrected, 3.0, error), GetParam().error_ratio * rms(reference, 3.0, error));
  }
  // Consistent; conservative where an early channel is extrapolated.
  const bool early = GetParam().name.starts_with("Early");
  EXPECT_GT(test::mean_nis(corrected, 3.0), early ? 0.6 : 0.85);
  EXPECT_LT(test::mean_nis(corrected, 3.0), 1.05);
  const auto uncorrected = test::run_observer(faulty, ideal, options);
  EXPECT_TRUE(rms(uncorrected, 3.0, theta_error) > 2.0 * rms(corrected, 3.0, theta_error) ||
              rms(uncorrected, 3.0, velocity_error) > 2.0 * rms(corrected, 3.0, velocity_error));
}

INSTANTIATE_TEST_SUITE_P(Channels, SensorErrors, testing::ValuesIn(cases()),
                         [](const auto& info) { return info.param.name; });

// The smoother is linearised about the filter's trajectory, so it is not quite as accurate as with
// ideal sensors.
TEST(SensorCorrection, WorksInTheSmoother) {
  const physics::Model ideal = paper_rig(Law::state_variable);
  const auto reference = smoothed(test::run_observer(ideal, ideal, {.duration_s = 4.0}), ideal);
  for (const Case& one : cases()) {
    if (one.name != "LateForce" && one.name != "Crosstalk" && one.name != "Hum") continue;
    physics::Model faulty = ideal;
    faulty.terms = one.terms;
    const auto corrected =
        smoothed(test::run_observer(faulty, faulty, {.duration_s = 4.0}), faulty);
    for (const auto& error : {theta_error, velocity_error}) {
      EXPECT_LT(rms(corrected, 2.0, error), 1.25 * rms(reference, 2.0, error)) << one.name;
    }
  }
}

// With other physics in the model, so with DualPrediction.
TEST(SensorCorrection, WorksWithOtherPhysics) {
  physics::Model ideal = paper_rig(Law::coulomb);
  ideal.terms = {{"cubic_stiffness", {}, {{"k3_n_m3", {2.0e4}}}}};
  physics::Model faulty = ideal;
  faulty.terms.push_back(sensor_term("channel_delay", Channel::velocity, {{"delay_s", {0.006}}}));
  faulty.terms.push_back(sensor_term("gain_error", Channel::friction_force, {{"gain", {1.4}}}));
  faulty.terms.push_back(hum(Channel::displacement, 0.001));
  const auto reference = test::run_observer(ideal, ideal, {.duration_s = 8.0});
  const auto corrected = test::run_observer(faulty, faulty, {.duration_s = 8.0});
  EXPECT_EQ(corrected.back().estimate.restarts, 0U);
  for (const auto& error : {theta_error, velocity_error}) {
    EXPECT_LT(rms(corrected, 3.0, error), 1.25 * rms(reference, 3.0, error));
  }
}

// The time of the daemon is not that of the recording from which the model was identified.
TEST(SensorCorrection, EstimatesHumOfUnknownPhaseAndAmplitude) {
  const physics::Model ideal = paper_rig(Law::state_variable);
  physics::Model faulty = ideal;
  faulty.terms = {hum(Channel::friction_force, 0.02)};
  physics::Model assumed = faulty;
  assumed.terms.front().parameters["phase_rad"] = {-2.5};
  assumed.terms.front().parameters["amplitude"] = {0.014};
  assumed.terms.front().parameters["frequency_hz"] = {50.3};
  const auto reference = test::run_observer(ideal, ideal);
  const auto corrected = test::run_observer(faulty, assumed);
  EXPECT_LT(rms(corrected, 3.0, theta_error), 1.15 * rms(reference, 3.0, theta_error));
}

TEST(SensorCorrection, EstimatesADriftedOffsetAfterAGap) {
  const physics::Model ideal = paper_rig(Law::state_variable);
  physics::Model faulty = ideal;
  faulty.terms = {sensor_term("sensor_drift", Channel::displacement, {{"rate_per_s", {0.0003}}}),
                  sensor_term("channel_delay", Channel::friction_force, {{"delay_s", {0.006}}}),
                  hum(Channel::friction_force, 0.01)};
  test::RunOptions options;
  options.modify = [](Frame& frame) {
    // No channel for half a second, later no force for two seconds.
    const bool all = frame.time_s() > 4.0 && frame.time_s() < 4.5;
    for (Channel channel : all_channels) {
      const bool force =
          channel == Channel::friction_force && frame.time_s() > 5.0 && frame.time_s() < 7.0;
      if (all || force) frame.invalidate(channel);
    }
  };
  const auto reference = test::run_observer(ideal, ideal, options);
  const auto corrected = test::run_observer(faulty, faulty, options);
  EXPECT_EQ(corrected.back().estimate.restarts, 0U);
  EXPECT_LT(rms(corrected, 8.0, theta_error), 1.4 * rms(reference, 8.0, theta_error));
  EXPECT_LT(rms(corrected, 8.0, velocity_error), 1.15 * rms(reference, 8.0, velocity_error));
}

// A slow source that is also delayed: the age is that of the reading, the delay comes before it.
TEST(SensorCorrection, AddsAgeAndDelay) {
  physics::Model faulty = paper_rig(Law::state_variable);
  faulty.terms = {sensor_term("channel_delay", Channel::displacement, {{"delay_s", {0.006}}}),
                  hum(Channel::displacement, 0.0005)};
  for (const int shortest : {1, 7}) {
    std::vector<Frame> past;
    test::RunOptions options;
    options.modify = [&past, shortest](Frame& frame) {
      past.push_back(frame);
      // A constant age would only shift the phase of the hum.
      const std::size_t age = static_cast<std::size_t>(shortest) + 4 * (past.size() % 2);
      if (past.size() <= age) return;
      const Frame& then = past[past.size() - 1 - age];
      frame.set(Channel::displacement, then[Channel::displacement]);
      frame.age_us[index_of(Channel::displacement)] = static_cast<std::int32_t>(1000 * age);
    };
    const auto corrected = test::run_observer(faulty, faulty, options);
    EXPECT_EQ(corrected.back().estimate.restarts, 0U) << shortest;
    EXPECT_EQ(corrected.back().estimate.refusals, 0U) << shortest;
    EXPECT_LT(test::mean_nis(corrected, 3.0), 1.1) << shortest;
    EXPECT_LT(rms(corrected, 3.0, theta_error), 0.02) << shortest;
  }
}

TEST(SensorCorrection, AGainThatAlsoAppliesToTheNoiseChangesNothing) {
  const physics::Model ideal = paper_rig(Law::state_variable);
  for (const Channel channel : {Channel::base_displacement, Channel::friction_force}) {
    physics::Model faulty = ideal;
    faulty.terms = {sensor_term("gain_error", channel, {{"gain", {4.0}}})};
    *faulty.sensors[index_of(channel)].noise_std *= 4.0;
    const auto one = test::run_observer(ideal, ideal, {.duration_s = 3.0});
    const auto four = test::run_observer(faulty, faulty, {.duration_s = 3.0});
    for (std::size_t k = 0; k < one.size(); k += 100) {
      EXPECT_NEAR(four[k].estimate.theta, one[k].estimate.theta, 1.0e-6);
    }
  }
}

TEST(SensorCorrection, ExtrapolatesAnEarlyUnfilteredChannel) {
  physics::Model ideal = paper_rig(Law::state_variable);
  ideal.sensors[index_of(Channel::displacement)].filters.clear();
  physics::Model faulty = ideal;
  faulty.terms = {sensor_term("channel_delay", Channel::displacement, {{"delay_s", {-0.004}}})};
  const auto reference = test::run_observer(ideal, ideal, {.duration_s = 8.0});
  const auto corrected = test::run_observer(faulty, faulty, {.duration_s = 8.0});
  const auto uncorrected = test::run_observer(faulty, ideal, {.duration_s = 8.0});
  EXPECT_LT(rms(corrected, 3.0, velocity_error), 1.5 * rms(reference, 3.0, velocity_error));
  EXPECT_GT(rms(uncorrected, 3.0, velocity_error), 2.0 * rms(corrected, 3.0, velocity_error));
}

TEST(SensorCorrection, CrosstalkOfAnUnmeasuredLoadFollowsFromTheModel) {
  physics::Model faulty = paper_rig(Law::state_variable);
  faulty.terms = {sensor_term("crosstalk", Channel::friction_force, {{"coefficient", {0.5}}},
                              Channel::normal_load)};
  test::RunOptions options;
  options.modify = [](Frame& frame) { frame.invalidate(Channel::normal_load); };
  const auto corrected = test::run_observer(faulty, faulty, options);
  EXPECT_LT(rms(corrected, 3.0, theta_error), 0.014);
  EXPECT_TRUE((corrected.back().estimate.innovation_valid >> index_of(Channel::friction_force)) &
              1U);
}

// Impossible corrected readings are not used.
TEST(SensorCorrection, KeepsEstimatesFiniteWithExtremeTerms) {
  const std::vector<physics::Term> terms = {
      sensor_term("gain_error", Channel::displacement, {{"gain", {1.0e-200}}}),
      sensor_term("gain_error", Channel::friction_force, {{"gain", {1.0e-6}}}),
      sensor_term("channel_delay", Channel::velocity, {{"delay_s", {1.0e-160}}}),
      sensor_term("channel_delay", Channel::velocity, {{"delay_s", {2.0e-7}}})};
  for (const physics::Term& term : terms) {
    physics::Model assumed = paper_rig(Law::coulomb);
    assumed.terms = {term};
    for (const Sample& m :
         test::run_observer(paper_rig(Law::coulomb), assumed, {.duration_s = 1.0})) {
      ASSERT_TRUE(std::isfinite(m.estimate.theta + m.estimate.displacement_m +
                                m.estimate.innovation_std[0] + m.estimate.nis))
          << term.id;
    }
  }
}

// Errors of the rig's model must not be attributed to the drive.
TEST(SensorCorrection, ADelayedDriveIsCorrectedByItsOwnChannelOnly) {
  physics::Model model = paper_rig(Law::coulomb);
  model.terms = {sensor_term("channel_delay", Channel::base_displacement, {{"delay_s", {0.006}}})};
  const SeparatedModel separated = separate_sensor_errors(model);
  std::string reason;
  const physics::Rig rig(separated.model);
  const Layout layout = make_layout(separated.model, rig, reason, separated.laws);
  KalmanFilter one(model, 1.0e-3);
  KalmanFilter other(model, 1.0e-3);
  const auto run = test::run_observer(model, model, {.duration_s = 2.0});
  for (const Sample& m : run) {
    one.update(m.frame);
    Frame frame = m.frame;
    if (&m == &run.back()) frame.set(Channel::velocity, m.frame[Channel::velocity] + 0.003);
    other.update(frame);
  }
  layout.of(Channel::base_displacement).for_each_state([&](int state) {
    EXPECT_EQ(one.mean()[state], other.mean()[state]) << state;
  });
  EXPECT_NE(one.mean()[layout.rig[physics::state::v]], other.mean()[layout.rig[physics::state::v]]);
}

// A likelihood is that of the readings, so innovations are in their units.
TEST(SensorCorrection, InnovationsAreInUnitsOfTheReading) {
  const physics::Model ideal = paper_rig(Law::state_variable);
  physics::Model faulty = ideal;
  faulty.terms = {sensor_term("gain_error", Channel::friction_force, {{"gain", {3.0}}})};
  // The same readings, scaled by three.
  faulty.sensors[index_of(Channel::friction_force)].noise_std = 3.0 * 6.0e-4;
  const auto one = test::run_observer(ideal, ideal, {.duration_s = 3.0});
  const auto three = test::run_observer(faulty, faulty, {.duration_s = 3.0});
  const auto innovation = [](const Sample& m) {
    return m.estimate.innovation[index_of(Channel::friction_force)];
  };
  EXPECT_NEAR(rms(three, 1.0, innovation), 3.0 * rms(one, 1.0, innovation),
              0.01 * rms(three, 1.0, innovation));
  EXPECT_NEAR(three.back().estimate.innovation_std[index_of(Channel::friction_force)],
              3.0 * one.back().estimate.innovation_std[index_of(Channel::friction_force)], 1.0e-6);
}

// exp(-i w delay), for the frequencies of a rig's motion.
TEST(SensorErrorStates, DelayASine) {
  constexpr double period_s = 1.0e-3;
  for (const double delay_s : {0.0003, 0.004, 0.011, 0.03}) {
    physics::Model model = paper_rig(Law::coulomb);
    model.terms = {sensor_term("channel_delay", Channel::displacement, {{"delay_s", {delay_s}}})};
    const SeparatedModel separated = separate_sensor_errors(model);
    const physics::Rig rig(separated.model);
    std::string reason;
    const Layout layout = make_layout(separated.model, rig, reason, separated.laws);
    ASSERT_EQ(reason, "");
    const SensorErrorStates states(layout, period_s);
    const Chain& chain = layout.of(Channel::displacement);
    const MeasurementRow row = measurement_row(layout, Channel::displacement, 0.0);
    for (const double frequency_hz : {2.4, 19.3, 50.0}) {
      const double w = 2.0 * std::numbers::pi * frequency_hz;
      Vector before = Vector::Zero(layout.count);
      Vector after = before;
      double worst = 0.0;
      for (int k = 1; k <= 2000; ++k) {
        const double t = k * period_s;
        Transition transition(layout.count);
        transition.clear();
        for (int i = 0; i < layout.count; ++i) transition.begin_row();
        after[chain.reading] = std::sin(w * t);
        states.advance(before, after, transition);
        double read = 0.0;
        for (std::size_t j = 0; j < static_cast<std::size_t>(row.count); ++j) {
          read += row.weight[j] * after[row.state[j]];
        }
        if (k > 500) worst = std::max(worst, std::abs(read - std::sin(w * (t - delay_s))));
        before = after;
      }
      EXPECT_LT(worst, frequency_hz < 20.0 ? 0.01 : 0.1) << delay_s << " s, " << frequency_hz;
    }
  }
}

TEST(SensorCorrection, RejectsModelsBeyondItsLimitsWithAReason) {
  physics::Model model = paper_rig(Law::state_variable);
  for (const Channel channel :
       {Channel::displacement, Channel::velocity, Channel::friction_force}) {
    model.terms.push_back(sensor_term("channel_delay", channel, {{"delay_s", {0.02}}}));
  }
  const FrictionObserver too_many(model, 1.0e-3);
  EXPECT_NE(too_many.unsupported().find("[[physics]]"), std::string::npos)
      << too_many.unsupported();

  model.terms = {{"differentiator_lag", {}, {{"cutoff_hz", {30.0}}}}};
  model.sensors[index_of(Channel::velocity)].filters = {
      {physics::FilterKind::butterworth_lowpass, 8, 100.0},
      {physics::FilterKind::butterworth_lowpass, 4, 100.0}};
  const FrictionObserver long_chain(model, 1.0e-3);
  EXPECT_NE(long_chain.unsupported().find("velocity channel has 7 filter sections"),
            std::string::npos)
      << long_chain.unsupported();

  model = paper_rig(Law::coulomb);
  model.sensors[index_of(Channel::friction_force)].filters.clear();
  model.terms = {sensor_term("channel_delay", Channel::friction_force, {{"delay_s", {-0.002}}})};
  const FrictionObserver early(model, 1.0e-3);
  EXPECT_NE(early.unsupported().find("friction_force channel is early"), std::string::npos)
      << early.unsupported();
}

}  // namespace
}  // namespace stickslip::observer
