// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "tools/commissioning/delay_fit.h"
#include "tools/commissioning/sine_fit.h"

namespace stickslip::commissioning {
namespace {

double motion(double t) { return std::sin(5.0 * t) + 0.5 * std::sin(13.0 * t + 1.0); }
double rate(double t) { return 5.0 * std::cos(5.0 * t) + 6.5 * std::cos(13.0 * t + 1.0); }

struct Pair {
  TimedReadings reference;
  TimedReadings channel;
};

template <class Function>
Pair pair_of(Function channel, double delay_s, double noise, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> error(0.0, noise);
  Pair out;
  for (int i = 0; i < 10000; ++i) {
    const double t = 1e-3 * i;
    out.reference.time_s.push_back(t);
    out.reference.value.push_back(motion(t));
    if (i % 8 != 0) continue;
    out.channel.time_s.push_back(t + 0.0003);
    out.channel.value.push_back(3.0 + 40.0 * channel(t + 0.0003 - delay_s) + 40.0 * error(random));
  }
  return out;
}

TEST(DelayFit, FindsTheDelayOfASlowChannelWithinItsUncertainty) {
  double squares = 0.0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Pair pair = pair_of(motion, 0.0123, 0.02, seed);
    const auto found = delay_of(pair.channel, pair.reference, Follows::value, 0.1);
    ASSERT_TRUE(found);
    EXPECT_GT(found->explained, 0.99);
    EXPECT_LT(found->sigma_s, 0.3e-3);
    squares += std::pow((found->delay_s - 0.0123) / found->sigma_s, 2);
  }
  EXPECT_GT(squares / 20, 0.3);
  EXPECT_LT(squares / 20, 3.0);
}

TEST(DelayFit, ComparesAVelocityWithTheRateOfTheReference) {
  const Pair pair = pair_of(rate, -0.004, 0.02, 7);
  const auto found = delay_of(pair.channel, pair.reference, Follows::rate, 0.1);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->delay_s, -0.004, 3e-4);
}

TEST(DelayFit, SaysHowLittleAnUnrelatedChannelFollows) {
  const Pair pair = pair_of([](double) { return 0.0; }, 0.0, 0.5, 3);
  const auto found = delay_of(pair.channel, pair.reference, Follows::value, 0.1);
  EXPECT_LT(found ? found->explained : 0.0, 0.1);
  EXPECT_FALSE(delay_of({}, pair.reference, Follows::value, 0.1));
  EXPECT_FALSE(delay_of(pair.channel, {}, Follows::value, 0.1));
}

TEST(SineFit, FindsMeanAmplitudeAndPhase) {
  std::vector<double> time_s;
  std::vector<double> value;
  for (int i = 0; i < 3000; ++i) {
    time_s.push_back(1e-3 * i);
    value.push_back(2.5 - 0.02 * std::sin(2.0 * std::numbers::pi * 3.2 * time_s.back() - 0.3));
  }
  const Sine found = sine_of(time_s, value, 3.2);
  EXPECT_NEAR(found.mean, 2.5, 1e-9);
  EXPECT_NEAR(found.amplitude, 0.02, 1e-9);
  EXPECT_NEAR(std::abs(found.phase), std::numbers::pi - 0.3, 1e-9);
}

}  // namespace
}  // namespace stickslip::commissioning
