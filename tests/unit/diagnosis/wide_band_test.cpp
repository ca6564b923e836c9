// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/wide_band.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <cstdlib>
#include <numbers>
#include <random>

namespace stickslip::diagnosis {
namespace {

using physics::Filter;
using physics::FilterChain;
using physics::FilterKind;

/// The same cases in every run, unless RC_PARAMS is set.
const int seeded = setenv("RC_PARAMS", "seed=20260102 max_success=40", 0);

constexpr double period_s = 1.0e-3;

// A tone after the chain, in steady state.
std::vector<double> filtered_tone(const FilterChain& chain, double frequency_hz,
                                  std::size_t count) {
  const auto response = chain.response(frequency_hz);
  std::vector<double> samples(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double phase = 2.0 * std::numbers::pi * frequency_hz * period_s * static_cast<double>(i);
    samples[i] = std::abs(response) * std::sin(phase + std::arg(response));
  }
  return samples;
}

RC_GTEST_PROP(WideBand, CorrectsTheFiltersOfATone, ()) {
  const double frequency_hz = 0.1 * *rc::gen::inRange(5, 150);
  const std::vector<Filter> filters = {{FilterKind::butterworth_lowpass, 4, 25.0}};
  const FilterChain chain(filters, period_s);
  const auto samples = filtered_tone(chain, frequency_hz, 4001);
  const WideBand got = wide_band(samples, period_s, chain, 1.0e-7);
  const double omega = 2.0 * std::numbers::pi * frequency_hz;
  for (std::size_t i = 1000; i <= 3000; ++i) {
    const double phase = omega * period_s * static_cast<double>(i);
    RC_ASSERT(std::abs(got.value[i] - std::sin(phase)) < 0.01);
    RC_ASSERT(std::abs(got.rate[i] - omega * std::cos(phase)) < 0.01 * omega);
    RC_ASSERT(std::abs(got.acceleration[i] + omega * omega * std::sin(phase)) <
              0.01 * omega * omega);
  }
}

// Lengths that are slow to transform must not cost accuracy. Two filters of the paper's chain,
// which amplify any ringing far above the noise.
TEST(WideBand, DoesNotDependOnTheNumberOfSamples) {
  const std::vector<Filter> filters = {{FilterKind::butterworth_lowpass, 4, 25.0},
                                       {FilterKind::butterworth_lowpass, 4, 25.0}};
  const FilterChain chain(filters, period_s);
  const double omega = 2.0 * std::numbers::pi * 2.5;
  for (const std::size_t count : {4001U, 4013U, 4037U, 4051U, 4096U, 4097U, 4200U}) {
    auto samples = filtered_tone(chain, 2.5, count);
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal(0.0, 2.0e-5);
    for (double& each : samples) each += normal(random);
    const WideBand got = wide_band(samples, period_s, chain, 2.0e-5);
    double worst = 0.0;
    for (std::size_t i = 500; i + 500 < count; ++i) {
      const double truth = -omega * omega * std::sin(omega * period_s * static_cast<double>(i));
      worst = std::max(worst, std::abs(got.acceleration[i] - truth));
    }
    EXPECT_LT(worst, 0.05 * omega * omega) << count << " samples";
  }
}

TEST(WideBand, CorrectsTheLagOfALine) {
  const std::vector<Filter> filters = {{FilterKind::first_order_lowpass, 1, 10.0}};
  const FilterChain chain(filters, period_s);
  const double lag_s = 1.0 / (2.0 * std::numbers::pi * 10.0);
  std::vector<double> samples(2000);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i] = 3.0 + 2.0 * (period_s * static_cast<double>(i) - lag_s);
  }
  const WideBand got = wide_band(samples, period_s, chain, 0.0);
  for (const std::size_t i : {std::size_t{0}, std::size_t{1000}, std::size_t{1999}}) {
    EXPECT_NEAR(got.value[i], 3.0 + 2.0 * period_s * static_cast<double>(i), 1.0e-5);
    EXPECT_NEAR(got.rate[i], 2.0, 1.0e-6);
    EXPECT_NEAR(got.acceleration[i], 0.0, 1.0e-5);
  }
}

// Undoing 25 Hz of fourth order would raise the noise above 100 Hz by 48 dB and more.
TEST(WideBand, DoesNotAmplifyNoise) {
  const std::vector<Filter> filters = {{FilterKind::butterworth_lowpass, 4, 25.0}};
  const FilterChain chain(filters, period_s);
  auto samples = filtered_tone(chain, 3.0, 8001);
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal(0.0, 1.0e-3);
  for (double& each : samples) each += normal(random);
  const WideBand got = wide_band(samples, period_s, chain, 1.0e-3);
  double square = 0.0;
  for (std::size_t i = 2000; i <= 6000; ++i) {
    const double error =
        got.value[i] - std::sin(2.0 * std::numbers::pi * 3.0 * period_s * static_cast<double>(i));
    square += error * error;
  }
  EXPECT_LT(std::sqrt(square / 4001.0), 1.0e-3);
}

TEST(NoiseOf, IsIndependentOfTheMotion) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(0.0, 2.0e-4);
  std::vector<double> samples(4000);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i] = std::sin(0.02 * static_cast<double>(i)) + normal(random);
  }
  samples[2000] += 5.0;  // the estimate is robust to a jump
  EXPECT_NEAR(noise_of(samples), 2.0e-4, 2.0e-5);
}

TEST(NoiseOf, IsAtLeastThatOfQuantisation) {
  std::vector<double> samples(4000);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i] = 0.01 * std::floor(100.0 * std::sin(0.001 * static_cast<double>(i)));
  }
  EXPECT_NEAR(noise_of(samples), 0.01 / std::sqrt(12.0), 1.0e-4);
}

TEST(NoiseOf, IsZeroForAConstantAndForTooFewSamples) {
  EXPECT_EQ(noise_of(std::vector<double>(100, 4.0)), 0.0);
  EXPECT_EQ(noise_of(std::vector<double>{1.0, 2.0, 1.0}), 0.0);
}

}  // namespace
}  // namespace stickslip::diagnosis
