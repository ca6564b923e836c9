// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/spectrum.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace stickslip::diagnosis {
namespace {

using std::numbers::pi;

// 20 s at 500 Hz: two slow sines, noise, and a line.
std::vector<double> recorded(double amplitude, double frequency_hz, double phase_rad) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  std::vector<double> values;
  for (int k = 0; k < 10000; ++k) {
    const double t = k / 500.0;
    values.push_back(std::sin(2.0 * pi * 2.3 * t) + 0.5 * std::sin(2.0 * pi * 7.1 * t) +
                     0.002 * normal(random) +
                     amplitude * std::sin(2.0 * pi * frequency_hz * t + phase_rad));
  }
  return values;
}

TEST(Mains, LineHasItsFrequencyAmplitudeAndPhase) {
  for (const double frequency_hz : {49.97, 60.05, 100.0, 150.1}) {
    const auto line = mains_of(recorded(0.01, frequency_hz, 0.8), 0.002);
    ASSERT_TRUE(line) << frequency_hz;
    EXPECT_NEAR(line->frequency_hz, frequency_hz, 1.0e-3);
    EXPECT_NEAR(line->amplitude, 0.01, 2.0e-4);
    EXPECT_NEAR(std::remainder(line->phase_rad - 0.8, 2.0 * pi), 0.0, 0.05);
  }
}

TEST(Mains, IgnoresOtherLines) {
  EXPECT_FALSE(mains_of(recorded(0.0, 50.0, 0.0), 0.002));
  EXPECT_FALSE(mains_of(recorded(0.01, 47.0, 0.0), 0.002));
}

TEST(Mains, IsRemovedWithoutOtherChanges) {
  const auto clean = recorded(0.0, 50.0, 0.0);
  const auto cleaned = without_mains(recorded(0.05, 50.02, -1.3), 0.002);
  const auto same = without_mains(clean, 0.002);
  double worst = 0.0;
  for (std::size_t k = 0; k < clean.size(); ++k) {
    worst = std::max(worst, std::abs(cleaned[k] - clean[k]));
    EXPECT_EQ(same[k], clean[k]);
  }
  EXPECT_LT(worst, 5.0e-4);  // of 0.05
}

}  // namespace
}  // namespace stickslip::diagnosis
