// SPDX-License-Identifier: Apache-2.0
#include "daemon/excitation.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

namespace stickslip::daemon {
namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;
constexpr double dt = 1e-3;

config::Excitation sine(double amplitude, double carrier_hz) {
  config::Excitation out;
  out.enabled = true;
  out.amplitude = amplitude;
  out.carrier_hz = carrier_hz;
  out.ramp_s = 0.5;
  return out;
}

void run(Excitation& excitation, double seconds) {
  for (int i = 0; i < static_cast<int>(std::lround(seconds / dt)); ++i) excitation.advance(dt);
}

TEST(Excitation, IsZeroUntilStartedAndIfDisabled) {
  Excitation off(sine(0.008, 2.5));
  EXPECT_EQ(off.advance(1.0).value, 0.0);
  config::Excitation disabled = sine(0.008, 2.5);
  disabled.enabled = false;
  Excitation excitation(disabled);
  excitation.start();
  EXPECT_EQ(excitation.advance(1.0).value, 0.0);
  EXPECT_TRUE(excitation.is_off());
}

TEST(Excitation, IsTheConfiguredSineAfterTheRamp) {
  Excitation excitation(sine(0.008, 2.5));
  excitation.start();
  double t = 0.0;
  for (int i = 0; i < 20000; ++i) {
    const Drive drive = excitation.advance(dt);
    t += dt;
    if (i >= 500) {
      ASSERT_NEAR(drive.value, 0.008 * std::sin(two_pi * 2.5 * t), 1e-12) << "at " << t << " s";
      ASSERT_DOUBLE_EQ(drive.amplitude, 0.008);
    }
  }
  EXPECT_EQ(excitation.state(), Excitation::State::steady);
}

TEST(Excitation, ModulationFollowsTheConfigurationsFormula) {
  config::Excitation settings = sine(0.01, 3.0);
  settings.modulation_hz = 0.1;
  settings.modulation_depth = 1.0;
  settings.ramp_s = 0.0;
  Excitation excitation(settings);
  excitation.start();
  for (int i = 1; i <= 20000; ++i) {
    const double t = i * dt;
    const double amplitude = 0.01 * (0.5 + 0.5 * std::cos(two_pi * 0.1 * t));
    ASSERT_NEAR(excitation.advance(dt).value, amplitude * std::sin(two_pi * 3.0 * t), 1e-12);
  }
}

TEST(Excitation, EnvelopeIsInterpolatedAndRepeated) {
  config::Excitation settings = sine(0.0, 3.0);
  settings.ramp_s = 0.0;
  settings.envelope = {{0.0, 0.0}, {1.0, 0.01}, {2.0, 0.0}};
  Excitation repeated(settings);
  repeated.start();
  run(repeated, 2.5);
  EXPECT_NEAR(repeated.now().amplitude, 0.005, 1e-9);
  settings.repeat = false;
  settings.envelope.back().amplitude = 0.002;
  Excitation once(settings);
  once.start();
  run(once, 5.0);
  EXPECT_NEAR(once.now().amplitude, 0.002, 1e-12);
}

TEST(Excitation, RampsToExactlyZeroWithinRampTimeFromAnyMoment) {
  for (const double before : {0.0, 0.1, 0.25, 0.5, 3.7}) {
    Excitation excitation(sine(0.008, 2.5));
    excitation.start();
    run(excitation, before);
    excitation.stop();
    int cycles = 0;
    while (!excitation.is_off()) {
      excitation.advance(dt);
      ASSERT_LE(++cycles, 501) << "stopped at " << before << " s";
    }
    EXPECT_EQ(excitation.now().value, 0.0);
    EXPECT_EQ(excitation.now().amplitude, 0.0);
  }
}

TEST(Excitation, CutIsZeroImmediately) {
  Excitation excitation(sine(0.008, 2.5));
  excitation.start();
  run(excitation, 1.03);
  ASSERT_NE(excitation.now().value, 0.0);
  excitation.cut();
  EXPECT_EQ(excitation.now().value, 0.0);
  EXPECT_EQ(excitation.advance(dt).value, 0.0);
}

// The drive never moves faster than carrier, modulation and ramp together explain, with any
// sequence of actions.
RC_GTEST_PROP(Excitation, NeverJumps, ()) {
  config::Excitation settings = sine(0.01, *rc::gen::inRange(1, 20) * 0.5);
  settings.modulation_hz = *rc::gen::inRange(0, 10) * 0.1;
  settings.modulation_depth = *rc::gen::inRange(0, 11) * 0.1;
  settings.ramp_s = *rc::gen::inRange(1, 10) * 0.1;
  settings.amplitude_slew = 0.01;
  settings.carrier_slew_hz_s = 10.0;
  // Of the carrier, the modulation, the ramp, and both parameters of the amplitude.
  const double rate =
      two_pi * 10.0 + 0.5 * two_pi * settings.modulation_hz + 1.5 / settings.ramp_s + 1.0 + 0.5;
  const double largest_step = 0.01 * rate * dt * 1.01;

  Excitation excitation(settings);
  double previous = 0.0;
  for (const int action : *rc::gen::container<std::vector<int>>(
           2000,
           rc::gen::weightedElement<int>({{500, 0}, {1, 1}, {1, 2}, {1, 3}, {1, 4}, {1, 5}}))) {
    if (action == 1) excitation.start();
    if (action == 2) excitation.stop();
    if (action == 3) excitation.set({Tunable::carrier_hz, *rc::gen::inRange(1, 20) * 0.5});
    if (action == 4) excitation.set({Tunable::amplitude, *rc::gen::inRange(0, 11) * 0.001});
    if (action == 5) excitation.set({Tunable::modulation_depth, *rc::gen::inRange(0, 11) * 0.1});
    const double value = excitation.advance(dt).value;
    RC_ASSERT(std::abs(value - previous) <= largest_step);
    previous = value;
  }
}

constexpr DrivenRig usual{{0.015, 0.5, 20.0}, Channel::base_displacement, dt};

/// Extremes of a drive and of its differences, from rest at zero.
class Extremes {
 public:
  void add(double value) {
    displacement = std::max(displacement, std::abs(value));
    velocity = std::max(velocity, std::abs(value - now_) / dt);
    acceleration = std::max(acceleration, std::abs(value - 2.0 * now_ + before_) / (dt * dt));
    before_ = now_;
    now_ = value;
  }
  bool within(const MotionLimits& limits) const {
    return displacement <= limits.displacement && velocity <= limits.velocity &&
           acceleration <= limits.acceleration;
  }
  double displacement = 0.0;
  double velocity = 0.0;
  double acceleration = 0.0;

 private:
  double now_ = 0.0;
  double before_ = 0.0;
};

// Any configuration and any settings, without the checks of the loader and of `refusal`.
RC_GTEST_PROP(Excitation, InternalDriveIsWithinTheLimits, ()) {
  config::Excitation settings = sine(0.001 * *rc::gen::inRange(0, 200), 0.5);
  settings.carrier_hz = *rc::gen::inRange(1, 200) * 0.5;
  settings.kind =
      *rc::gen::element(config::ExcitationKind::modulated, config::ExcitationKind::by_hand,
                        config::ExcitationKind::sweep, config::ExcitationKind::chirp,
                        config::ExcitationKind::multisine);
  settings.sweep = {.from_hz = 90.0, .to_hz = 1.0, .duration_s = 1.5, .taper_s = 0.01};
  settings.multisine = {{}, 10, 1.0, 80.0};
  settings.ramp_s = *rc::gen::inRange(0, 3) * 0.1;
  settings.amplitude_slew = 10.0;
  settings.carrier_slew_hz_s = 1000.0;
  Excitation excitation(settings, usual);
  Extremes extremes;
  for (const int action : *rc::gen::container<std::vector<int>>(
           3000, rc::gen::weightedElement<int>({{500, 0}, {3, 1}, {1, 2}, {3, 3}, {3, 4}}))) {
    if (action == 1) excitation.start();
    if (action == 2) excitation.stop();
    if (action == 3) excitation.set({Tunable::carrier_hz, *rc::gen::inRange(1, 200) * 0.5});
    if (action == 4) excitation.set({Tunable::amplitude, 0.001 * *rc::gen::inRange(0, 200)});
    // After an overrun, more than one period has passed.
    extremes.add(excitation.advance(action == 3 ? 5.0 * dt : dt).value);
    RC_ASSERT(extremes.within(usual.limits));
  }
}

TEST(Excitation, WithinItsLimitsIsUnchangedByThem) {
  config::Excitation settings = sine(0.012, 2.5);
  settings.modulation_hz = 0.1;
  settings.modulation_depth = 0.9;
  Excitation free(settings);
  Excitation limited(settings, usual);
  free.start();
  limited.start();
  for (int i = 0; i < 30'000; ++i) ASSERT_EQ(free.advance(dt), limited.advance(dt)) << i;
}

TEST(Excitation, AStopKeepsTheLimitsAndEndsAtRest) {
  config::Excitation settings = sine(0.012, 4.0);
  settings.ramp_s = 0.0;  // no ramp
  for (const double before : {0.31, 0.37, 0.41, 0.44}) {
    Excitation excitation(settings, usual);
    excitation.start();
    Extremes extremes;
    for (int i = 0; i < std::lround(before / dt); ++i) extremes.add(excitation.advance(dt).value);
    excitation.stop();
    int cycles = 0;
    while (!excitation.is_off()) {
      extremes.add(excitation.advance(dt).value);
      ASSERT_LE(++cycles, 300);
    }
    for (int i = 0; i < 3; ++i) extremes.add(excitation.advance(dt).value);
    EXPECT_GT(cycles, 20);
    EXPECT_EQ(excitation.now().value, 0.0);
    EXPECT_TRUE(extremes.within(usual.limits)) << before;
  }
}

TEST(Excitation, IsUnchangedWithoutElapsedTime) {
  Excitation excitation(sine(0.008, 2.5), usual);
  excitation.start();
  run(excitation, 1.03);
  const Drive before = excitation.now();
  for (int i = 0; i < 100; ++i) EXPECT_EQ(excitation.advance(0.0), before);
}

TEST(Excitation, CarrierAndAmplitudeChangeAtALimitedRateWithContinuousPhase) {
  config::Excitation settings = sine(0.008, 2.5);
  settings.amplitude_slew = 0.004;
  settings.carrier_slew_hz_s = 0.5;
  Excitation excitation(settings, usual);
  excitation.start();
  run(excitation, 2.0);
  excitation.set({Tunable::carrier_hz, 3.5});
  excitation.set({Tunable::amplitude, 0.010});
  double phase = excitation.now().phase_turns;
  for (int i = 0; i < 4000; ++i) {
    const Drive before = excitation.now();
    const Drive drive = excitation.advance(dt);
    phase += drive.carrier_hz * dt;
    phase -= std::floor(phase);
    ASSERT_NEAR(std::remainder(drive.phase_turns - phase, 1.0), 0.0, 1e-9);
    ASSERT_LE(std::abs(drive.carrier_hz - before.carrier_hz), 0.5 * dt * 1.001);
    ASSERT_LE(std::abs(drive.amplitude - before.amplitude), 0.004 * dt * 1.001);
    ASSERT_EQ(drive.limited, Limit::none);
  }
  EXPECT_EQ(excitation.now().carrier_hz, 3.5);
  EXPECT_EQ(excitation.now().amplitude, 0.010);
  run(excitation, 100.0);
  EXPECT_EQ(excitation.now().amplitude, 0.010);
}

// 12 mm at 2.5 Hz and 3 mm at 9 Hz are both within the limits; 12 mm at 9 Hz is far beyond.
TEST(Excitation, BetweenTwoSettingsTheChangeThatReducesTheMotionComesFirst) {
  Excitation excitation(sine(0.012, 2.5), usual);
  excitation.start();
  run(excitation, 3.0);
  for (const Setting& setting :
       {Setting{Tunable::carrier_hz, 9.0}, Setting{Tunable::amplitude, 0.003},
        Setting{Tunable::amplitude, 0.012}, Setting{Tunable::carrier_hz, 2.5}}) {
    excitation.set(setting);
    const bool pair = setting.tunable == Tunable::amplitude && setting.value == 0.003;
    if (!pair && setting.value != 2.5) continue;  // two settings at a time
    for (int i = 0; i < 15'000; ++i) ASSERT_EQ(excitation.advance(dt).limited, Limit::none) << i;
    EXPECT_EQ(excitation.now().carrier_hz, pair ? 9.0 : 2.5);
    EXPECT_EQ(excitation.now().amplitude, pair ? 0.003 : 0.012);
  }
}

TEST(Excitation, AnInvalidSettingIsIgnored) {
  Excitation excitation(sine(0.008, 2.5));
  excitation.start();
  run(excitation, 2.0);
  for (const double value : {std::nan(""), -1.0, HUGE_VAL}) {
    excitation.set({Tunable::carrier_hz, value});
    excitation.set({Tunable::amplitude, value});
    excitation.set({Tunable::modulation_depth, value});
  }
  excitation.set({Tunable::carrier_hz, 0.0});
  excitation.set({Tunable::modulation_depth, 1.5});
  run(excitation, 5.0);
  EXPECT_EQ(excitation.now().carrier_hz, 2.5);
  EXPECT_EQ(excitation.now().amplitude, 0.008);
}

TEST(Excitation, ASweepRestartsAtEachStart) {
  config::Excitation settings = sine(0.004, 2.5);
  settings.kind = config::ExcitationKind::sweep;
  settings.sweep = {.from_hz = 2.0, .to_hz = 6.0, .duration_s = 4.0};
  Excitation excitation(settings, usual);
  for (int i = 0; i < 2; ++i) {
    excitation.start();
    run(excitation, 2.0);
    EXPECT_NEAR(excitation.now().carrier_hz, 4.0, 1e-9);
    excitation.stop();
    run(excitation, 1.0);
    EXPECT_TRUE(excitation.is_off());
  }
}

TEST(Excitation, TheGainOfTheControlPassesTheLimitsToo) {
  config::Excitation settings = sine(0.010, 2.5);
  settings.control.enabled = true;
  Excitation excitation(settings, {{0.012, 0.5, 20.0}, Channel::base_displacement, dt});
  excitation.start();
  Extremes extremes;
  for (int i = 0; i < 30'000; ++i) {
    Frame frame;
    frame.set(Channel::base_displacement, 0.5 * excitation.now().value);  // a weak shaker
    excitation.observe(frame, true);
    extremes.add(excitation.advance(dt).value);
  }
  EXPECT_TRUE(extremes.within({0.012, 0.5, 20.0}));
  EXPECT_GT(extremes.displacement, 0.0118);
  EXPECT_EQ(excitation.control()->hold(), Hold::limited);
}

TEST(Refusal, NamesTheLimitAndTheLargestAllowedValue) {
  const config::Excitation excitation = sine(0.008, 2.5);
  const SettingBounds bounds;
  EXPECT_EQ(refusal(excitation, bounds, {Tunable::amplitude, 0.012}), std::nullopt);
  EXPECT_EQ(
      refusal(excitation, bounds, {Tunable::amplitude, 0.018}),
      "amplitude = 0.018 requires 0.018 m, limits.displacement_m allows 0.015: at most 0.015");
  EXPECT_EQ(refusal(excitation, bounds, {Tunable::carrier_hz, 9.0}),
            "carrier_hz = 9 requires 25.58 m/s^2, limits.acceleration_m_s2 allows 20: at most "
            "7.957");
  EXPECT_EQ(refusal(excitation, bounds, {Tunable::carrier_hz, 7.957}), std::nullopt);
  EXPECT_EQ(refusal(excitation, {.control_gain = 2.0}, {Tunable::amplitude, 0.009}),
            "amplitude = 0.009 requires 0.018 m, limits.displacement_m allows 0.015: at most "
            "0.0075");
  EXPECT_EQ(refusal(excitation, {.force = true}, {Tunable::amplitude, 6.0}),
            "amplitude = 6 requires 6 N, limits.force_n allows 5: at most 5");
  EXPECT_EQ(refusal(excitation, {.rate_hz = 100.0}, {Tunable::carrier_hz, 30.0}),
            "carrier_hz = 30 is more than a quarter of loop.rate_hz: at most 25");
  EXPECT_EQ(refusal(excitation, bounds, {Tunable::modulation_depth, 1.5}),
            "modulation_depth = 1.5: expected a number, from 0 to 1");
  EXPECT_EQ(refusal(excitation, bounds, {Tunable::amplitude, std::nan("")}),
            "amplitude = nan: expected a number, 0 or more");
}

TEST(Refusal, ParameterThatTheKindLacks) {
  config::Excitation excitation = sine(0.004, 2.5);
  excitation.kind = config::ExcitationKind::sweep;
  excitation.sweep = {.from_hz = 2.0, .to_hz = 6.0, .duration_s = 10.0};
  EXPECT_EQ(refusal(excitation, {}, {Tunable::carrier_hz, 3.0}),
            "carrier_hz cannot be set: the excitation's kind is \"sweep\"");
  EXPECT_EQ(refusal(excitation, {}, {Tunable::amplitude, 0.005}), std::nullopt);
  config::Excitation table = sine(0.0, 2.5);
  table.envelope = {{0.0, 0.001}, {1.0, 0.001}};
  EXPECT_EQ(refusal(table, {}, {Tunable::amplitude, 0.005}),
            "amplitude cannot be set: the excitation's kind is \"modulated\" with an envelope");
  EXPECT_EQ(tunable_named("carrier_hz"), Tunable::carrier_hz);
  EXPECT_EQ(tunable_named("offset"), std::nullopt);
}

// Settings that are allowed are never limited.
RC_GTEST_PROP(Refusal, AgreesWithTheLimits, ()) {
  config::Excitation settings = sine(0.001 * *rc::gen::inRange(1, 20), 0.25);
  settings.carrier_hz = *rc::gen::inRange(2, 40) * 0.25;
  settings.modulation_hz = *rc::gen::inRange(0, 10) * 0.1;
  settings.modulation_depth = *rc::gen::inRange(0, 11) * 0.1;
  settings.ramp_s = 5.0;
  const double before = *rc::gen::inRange(1, 1000) * 1e-6;
  RC_PRE(!refusal(settings, {}, {Tunable::amplitude, before}));
  const Setting wanted{Tunable::amplitude, settings.amplitude};
  const bool granted = !refusal(settings, {}, wanted);
  Excitation excitation(settings, usual);
  excitation.start();
  bool limited = false;
  for (int i = 0; i < 20'000; ++i) {
    limited = limited || excitation.advance(dt).limited != Limit::none;
  }
  RC_ASSERT(!granted || !limited);
}

}  // namespace
}  // namespace stickslip::daemon
