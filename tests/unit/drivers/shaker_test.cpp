// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulated/shaker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace stickslip::drivers {
namespace {

constexpr double period_s = 1.0e-3;
constexpr int steps = 10;
constexpr int settled = 1000;                      // cycles
constexpr std::size_t from = settled * steps / 2;  // samples; the second half
constexpr double bandwidth_hz = 60.0;
constexpr double two_pi = 2.0 * std::numbers::pi;

/// A shaker that has followed a sine of the amplitude 12 mm for a second.
struct Shaken {
  Shaken() {
    for (int i = 0; i < settled; ++i) cycle(sine(i), true);
  }
  static double sine(int i) { return 0.012 * std::sin(two_pi * 3.0 * i * period_s); }

  void cycle(double drive, bool amplifier_on) {
    shaker.command(drive, amplifier_on);
    shaker.begin_cycle();
    for (int k = 0; k < steps; ++k) {
      shaker.advance();
      output.push_back(shaker.output());
      acceleration.push_back(shaker.acceleration());
    }
  }

  Shaker shaker{physics::Excitation::base, bandwidth_hz, period_s, steps};
  std::vector<double> output, acceleration;
};

double largest(const std::vector<double>& values, std::size_t first) {
  double out = 0.0;
  for (std::size_t i = first; i < values.size(); ++i) out = std::max(out, std::abs(values[i]));
  return out;
}

TEST(Shaker, SineIsTransmittedWithItsAmplitude) {
  const Shaken shaken;
  EXPECT_NEAR(largest(shaken.output, from), 0.012, 0.012 * 1.0e-3);
  const double expected = 0.012 * std::pow(two_pi * 3.0, 2);
  EXPECT_NEAR(largest(shaken.acceleration, from), expected, 1.0e-3 * expected);
}

TEST(Shaker, AccelerationIsTheSecondDerivativeAndHasNoSteps) {
  const Shaken shaken;
  const double h = period_s / steps;
  const double peak = largest(shaken.acceleration, from);
  for (std::size_t i = from + 1; i + 1 < shaken.output.size(); ++i) {
    const double second =
        (shaken.output[i + 1] - 2.0 * shaken.output[i] + shaken.output[i - 1]) / (h * h);
    ASSERT_NEAR(shaken.acceleration[i], second, 1.0e-3 * peak) << i;
    // A sine of 3 Hz changes by at most 0.19 % of its peak in a tenth of a millisecond; steps of
    // the commands would be 1.9 % of its amplitude.
    ASSERT_LT(std::abs(shaken.acceleration[i] - shaken.acceleration[i - 1]), 0.0025 * peak) << i;
  }
}

TEST(Shaker, ComesToRestSmoothlyWithTheAmplifierOff) {
  // Off at rest, at the highest velocity, and in between.
  for (const int phase : {0, 40, 83, 120, 167, 210}) {
    Shaken shaken;
    for (int i = 0; i < phase; ++i) shaken.cycle(Shaken::sine(settled + i), true);
    const std::size_t off = shaken.output.size();
    const double moving = largest(shaken.acceleration, from);
    for (int i = 0; i < 1500; ++i) shaken.cycle(0.012, false);
    EXPECT_LT(largest(shaken.output, off), 0.0135) << phase;
    EXPECT_LT(largest(shaken.acceleration, off), 4.0 * moving) << phase;
    EXPECT_LT(largest(shaken.output, off + 1000 * steps), 1.0e-5) << phase;
    EXPECT_LT(largest(shaken.acceleration, off + 1000 * steps), 1.0e-2) << phase;
  }
}

TEST(Shaker, NonFiniteDriveCausesNoMotion) {
  Shaker shaker(physics::Excitation::base, bandwidth_hz, period_s, steps);
  for (const double drive :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    shaker.command(drive, true);
    shaker.begin_cycle();
    shaker.advance();
    EXPECT_EQ(shaker.output(), 0.0);
    EXPECT_EQ(shaker.acceleration(), 0.0);
  }
}

TEST(Shaker, ForceDropsImmediately) {
  Shaker shaker(physics::Excitation::force, bandwidth_hz, period_s, steps);
  const auto cycles = [&shaker](int count, double drive, bool on) {
    for (int i = 0; i < count; ++i) {
      shaker.command(drive, on);
      shaker.begin_cycle();
      for (int k = 0; k < steps; ++k) shaker.advance();
    }
  };
  cycles(200, 5.0, true);
  EXPECT_NEAR(shaker.output(), 5.0, 1.0e-6);
  cycles(60, 5.0, false);
  EXPECT_NEAR(shaker.output(), 0.0, 1.0e-3);
}

TEST(Shaker, SlowLoopsDriveSmoothly) {
  // 3 Hz in 100 commands a second: the images of the commands are far below the sine itself.
  Shaker shaker(physics::Excitation::base, bandwidth_hz, 0.01, 20);
  std::vector<double> acceleration;
  for (int i = 0; i < 300; ++i) {
    shaker.command(0.01 * std::sin(two_pi * 3.0 * i * 0.01), true);
    shaker.begin_cycle();
    for (int k = 0; k < 20; ++k) {
      shaker.advance();
      if (i >= 200) acceleration.push_back(shaker.acceleration());
    }
  }
  const double expected = 0.01 * std::pow(two_pi * 3.0, 2);
  EXPECT_NEAR(largest(acceleration, 0), expected, 0.25 * expected);
}

}  // namespace
}  // namespace stickslip::drivers
