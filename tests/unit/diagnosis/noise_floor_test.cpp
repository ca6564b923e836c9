// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/noise_floor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "diagnosis/wide_band.h"

namespace stickslip::diagnosis {
namespace {

constexpr double period_s = 2.0e-3;

// Noise of variance 1, of which `slow` is correlated over `memory_s`.
std::vector<double> coloured(std::size_t count, double slow, double memory_s, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const double keep = std::exp(-period_s / memory_s);
  std::vector<double> out(count);
  double state = normal(random);
  for (double& each : out) {
    state = keep * state + std::sqrt(1.0 - keep * keep) * normal(random);
    each = std::sqrt(slow) * state + std::sqrt(1.0 - slow) * normal(random);
  }
  return out;
}

// Power of that noise by frequency, 1 for white noise of variance 1.
double power_at(double frequency_hz, double slow, double memory_s) {
  const double keep = std::exp(-period_s / memory_s);
  const double cosine = std::cos(2.0 * std::numbers::pi * frequency_hz * period_s);
  return slow * (1.0 - keep * keep) / (1.0 - 2.0 * keep * cosine + keep * keep) + 1.0 - slow;
}

// An amplitude-modulated base, neither of whose periods fits into the recording.
double modulated(double time_s) {
  const double turn = 2.0 * std::numbers::pi * time_s;
  return (1.0 + 0.4 * std::sin(0.23 * turn)) * std::sin(2.71 * turn);
}

TEST(NoiseFloor, IsThatOfColouredNoiseBeneathLines) {
  for (const std::size_t count : {2000U, 12000U}) {
    auto samples = coloured(count, 0.6, 0.015, 5);
    const double white = noise_of(samples);
    for (std::size_t i = 0; i < count; ++i) {
      samples[i] += 1000.0 * modulated(period_s * static_cast<double>(i));
    }
    const NoiseFloor floor(samples, period_s, white);
    for (const double frequency_hz : {0.5, 3.0, 10.0, 40.0, 200.0}) {
      const double expected = power_at(frequency_hz, 0.6, 0.015);
      EXPECT_NEAR(std::log(floor.at(frequency_hz) / expected), 0.0, 0.6)
          << frequency_hz << " Hz of " << count << " samples";
    }
  }
}

TEST(NoiseFloor, IsNotThatOfASweep) {
  auto samples = coloured(12000, 0.0, 1.0, 6);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const double time_s = period_s * static_cast<double>(i);
    samples[i] += 100.0 * std::sin(2.0 * std::numbers::pi * (2.0 + 0.2 * time_s) * time_s);
  }
  const NoiseFloor floor(samples, period_s, 1.0);
  EXPECT_EQ(floor.at(5.0), 1.0);
}

// The error that is reported is that of the drive: noise of the base is one of its acceleration.
TEST(NoiseFloor, StatesTheErrorOfADrive) {
  const std::size_t count = 12000;
  auto samples = coloured(count, 0.6, 0.015, 7);
  for (std::size_t i = 0; i < count; ++i) {
    samples[i] = 5.0e-6 * samples[i] + 5.0e-3 * modulated(period_s * static_cast<double>(i));
  }
  const WideBand got =
      wide_band(samples, period_s, {}, NoiseFloor(samples, period_s, noise_of(samples)));
  double square = 0.0, peak = 0.0;
  for (std::size_t i = 500; i + 500 < count; ++i) {
    const double time_s = period_s * static_cast<double>(i);
    const double h = 1.0e-3;
    const double truth = 5.0e-3 *
                         (modulated(time_s + h) - 2.0 * modulated(time_s) + modulated(time_s - h)) /
                         (h * h);
    square += std::pow(got.acceleration[i] - truth, 2);
    peak = std::max(peak, std::abs(truth));
  }
  const double error = std::sqrt(square / static_cast<double>(count - 1000));
  EXPECT_LT(error, 0.02 * peak);
  EXPECT_LT(error, 2.0 * got.acceleration_noise_std);
}

}  // namespace
}  // namespace stickslip::diagnosis
