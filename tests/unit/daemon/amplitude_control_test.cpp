// SPDX-License-Identifier: Apache-2.0
#include "daemon/amplitude_control.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>

#include "daemon/excitation.h"
#include "drivers/simulated/shaker.h"

namespace stickslip::daemon {
namespace {

constexpr double h = 1e-3;
constexpr double asked = 0.008;

config::Excitation controlled(double carrier_hz = 2.5) {
  config::Excitation out;
  out.enabled = true;
  out.carrier_hz = carrier_hz;
  out.amplitude = asked;
  out.control.enabled = true;
  return out;
}

/// The control loop around a simulated shaker: amplifier, four-pole low-pass of 60 Hz, and a sensor
/// with noise and offset.
class Bench {
 public:
  explicit Bench(const config::Excitation& settings, const MotionLimits& limits = {0.02, 0.6, 30.0})
      : excitation(settings, DrivenRig{limits, Channel::base_displacement, h}) {
    excitation.start();
  }

  void step() {
    shaker.begin_cycle();
    shaker.advance();
    Frame frame;
    const double base = shaker.output();
    if (measured) frame.set(Channel::base_displacement, base + 0.0005 + noise_(random_));
    excitation.observe(frame, !excitation.is_off());
    const double before = excitation.control()->gain();
    const Drive& drive = excitation.advance(h);
    largest_gain_step = std::max(largest_gain_step, std::abs(last_gain_ - before));
    last_gain_ = before;
    shaker.command(amplifier(drive.value, time_s), !excitation.is_off());
    time_s += h;
    peak = std::max(peak, std::abs(base));
  }
  void run(double seconds) {
    for (int i = 0; i < static_cast<int>(std::lround(seconds / h)); ++i) step();
  }
  /// Largest displacement of the base during the next seconds.
  double reached_in(double seconds) {
    peak = 0.0;
    run(seconds);
    return peak;
  }

  Excitation excitation;
  drivers::Shaker shaker{physics::Excitation::base, 60.0, h, 1};
  std::function<double(double, double)> amplifier = [](double u, double) { return u; };
  bool measured = true;
  double time_s = 0.0;
  double peak = 0.0;
  double largest_gain_step = 0.0;

 private:
  double last_gain_ = 1.0;
  std::mt19937 random_{3};
  std::normal_distribution<double> noise_{0.0, 1e-5};
};

TEST(AmplitudeControl, CompensatesAGainErrorOfThirtyPercentWithoutOvershoot) {
  for (const double carrier_hz : {2.5, 6.0}) {
    for (const double gain : {0.7, 1.3}) {
      Bench bench(controlled(carrier_hz));
      bench.amplifier = [gain](double u, double) { return gain * u; };
      const double start = bench.reached_in(2.0);
      EXPECT_LE(start, std::max(1.0, gain) * asked * 1.01);
      const double later = bench.reached_in(6.0);
      EXPECT_LE(later, std::max(1.05, gain) * asked);
      EXPECT_NEAR(bench.reached_in(2.0), asked, 0.005 * asked) << gain << " at " << carrier_hz;
      EXPECT_NEAR(bench.excitation.control()->gain(), 1.0 / gain, 0.005 / gain);
      // And stays there for a minute.
      const double highest = bench.reached_in(60.0);
      EXPECT_NEAR(highest, asked, 0.005 * asked);
      EXPECT_EQ(bench.excitation.control()->hold(), Hold::none);
      EXPECT_LT(bench.largest_gain_step, 0.7 * h);
    }
  }
}

TEST(AmplitudeControl, FollowsADrift) {
  Bench bench(controlled());
  bench.amplifier = [](double u, double t) { return u * std::exp(-0.01 * t); };
  bench.run(15.0);
  for (int i = 0; i < 20; ++i) EXPECT_NEAR(bench.reached_in(1.0), asked, 0.005 * asked) << i;
}

// With the amplitude modulated down to a tenth, the gain stays that of the shaker.
TEST(AmplitudeControl, EstimatesAGainAndNotALevel) {
  config::Excitation settings = controlled(3.2);
  settings.modulation_hz = 0.11;
  settings.modulation_depth = 0.9;
  Bench bench(settings);
  bench.amplifier = [](double u, double) { return 0.75 * u; };
  bench.run(15.0);
  for (int i = 0; i < 30'000; ++i) {
    bench.step();
    ASSERT_NEAR(bench.excitation.control()->gain() * 0.75, 1.0, 0.01) << bench.time_s;
  }
}

// Beyond the amplifier's range the gain stays near that of its linear range, and a smaller
// amplitude is then reached correctly.
TEST(AmplitudeControl, DoesNotWindUpOnASaturatedAmplifier) {
  const auto hard = [](double u, double) { return std::clamp(0.9 * u, -0.006, 0.006); };
  const auto soft = [](double u, double) { return 0.01 * std::tanh(0.9 * u / 0.01); };
  for (const auto& amplifier : {std::function<double(double, double)>(hard), {soft}}) {
    Bench bench(controlled());
    bench.amplifier = amplifier;
    bench.run(60.0);
    EXPECT_EQ(bench.excitation.control()->hold(), Hold::saturated);
    EXPECT_LT(bench.excitation.control()->gain() * 0.9, 1.06);
    bench.excitation.set({Tunable::amplitude, 0.003});
    bench.run(2.0);
    EXPECT_LE(bench.reached_in(10.0), 0.003 * 1.05);
    EXPECT_NEAR(bench.reached_in(2.0), 0.003, 0.008 * 0.003);
  }
}

TEST(AmplitudeControl, IsHeldWhileTheLimitsAct) {
  Bench bench(controlled(), {0.007, 0.6, 30.0});
  bench.amplifier = [](double u, double) { return 0.7 * u; };
  bench.run(20.0);
  EXPECT_EQ(bench.excitation.control()->hold(), Hold::limited);
  EXPECT_EQ(bench.excitation.control()->gain(), 1.0);
  // Within the limits the control resumes.
  bench.excitation.set({Tunable::amplitude, 0.003});
  bench.run(12.0);
  EXPECT_NEAR(bench.reached_in(1.0), 0.003, 0.015 * 0.003);
}

TEST(AmplitudeControl, IsHeldWithoutAMeasurementOrAnAmplifier) {
  Bench bench(controlled());
  bench.amplifier = [](double u, double) { return 0.8 * u; };
  bench.run(10.0);
  const double gain = bench.excitation.control()->gain();
  bench.measured = false;
  bench.amplifier = [](double u, double) { return 0.5 * u; };
  bench.run(10.0);
  EXPECT_EQ(bench.excitation.control()->gain(), gain);
  EXPECT_EQ(bench.excitation.control()->hold(), Hold::no_measurement);
  bench.measured = true;
  bench.excitation.cut();
  bench.run(5.0);
  EXPECT_EQ(bench.excitation.control()->gain(), gain);
  EXPECT_EQ(bench.excitation.control()->hold(), Hold::amplifier_off);
}

// A sensor that reads zero must not drive the gain to its maximum.
TEST(AmplitudeControl, IgnoresADeadSensor) {
  Bench bench(controlled());
  bench.amplifier = [](double, double) { return 0.0; };
  bench.run(20.0);
  EXPECT_EQ(bench.excitation.control()->gain(), 1.0);
  EXPECT_EQ(bench.excitation.control()->hold(), Hold::implausible);
}

TEST(AmplitudeControl, StaysWithinItsRange) {
  config::Excitation settings = controlled();
  settings.control.gain_max = 1.2;
  Bench bench(settings);
  bench.amplifier = [](double u, double) { return 0.7 * u; };
  bench.run(30.0);
  EXPECT_EQ(bench.excitation.control()->gain(), 1.2);
  bench.amplifier = [](double u, double) { return u; };
  bench.run(8.0);
  EXPECT_NEAR(bench.reached_in(1.0), asked, 0.005 * asked);
}

TEST(AmplitudeControl, FollowsASweep) {
  config::Excitation settings = controlled();
  settings.kind = config::ExcitationKind::sweep;
  settings.amplitude = 0.006;
  settings.sweep = {
      .from_hz = 2.0, .to_hz = 6.0, .duration_s = 60.0, .at_end = config::SweepEnd::repeat};
  Bench bench(settings);
  bench.amplifier = [](double u, double) { return 1.2 * u; };
  bench.run(12.0);
  for (int i = 0; i < 100; ++i) EXPECT_NEAR(bench.reached_in(1.0), 0.006, 0.01 * 0.006) << i;
}

// A carrier near a quarter of the sampling rate.
TEST(AmplitudeControl, WorksWithFewSamplesInAPeriod) {
  AmplitudeControl control({.enabled = true}, h);
  double turns = 0.0;
  for (int i = 0; i < 20'000; ++i) {
    turns += 0.237;
    turns -= std::floor(turns);
    Drive drive;
    drive.amplitude = 1e-4;
    drive.carrier_hz = 237.0;
    drive.phase_turns = turns;
    const double lagging = std::sin(2.0 * std::numbers::pi * (turns - 0.3));
    control.update(0.8 * control.gain() * 1e-4 * lagging, true, drive, Hold::none);
  }
  EXPECT_NEAR(control.gain(), 1.25, 0.005);
  control.update(std::numeric_limits<double>::quiet_NaN(), true, {}, Hold::none);
  EXPECT_NEAR(control.gain(), 1.25, 0.005);
}

}  // namespace
}  // namespace stickslip::daemon
