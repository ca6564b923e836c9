// SPDX-License-Identifier: Apache-2.0
#include "drivers/clock/arrival_scatter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "drivers/clock/device_clock.h"

namespace stickslip::drivers {
namespace {

constexpr double ms = 1e6;

/// After messages of that period, each late by a random time, some of them missing.
double sigma_ns(double period_ns, double scatter_ns, double missing) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> late(0.0, scatter_ns);
  std::uniform_real_distribution<double> chance(0.0, 1.0);
  ArrivalScatter scatter(std::llround(8 * ms));
  double sum = 0.0;
  int count = 0;
  for (int i = 0; i < 5000; ++i) {
    if (chance(random) < missing) continue;
    scatter.add(std::llround(1e9 + i * period_ns + late(random)));
    if (i < 1000) continue;
    sum += static_cast<double>(scatter.sigma_ns());
    ++count;
  }
  return sum / count;
}

TEST(ArrivalScatter, IsTheStandardDeviationOfTheArrivals) {
  for (const double scatter_ns : {0.02 * ms, 0.2 * ms, 1.0 * ms}) {
    for (const double period_ns : {8.0 * ms, 8.2 * ms}) {
      EXPECT_NEAR(sigma_ns(period_ns, scatter_ns, 0.0) / scatter_ns, 1.0, 0.15);
      EXPECT_NEAR(sigma_ns(period_ns, scatter_ns, 0.05) / scatter_ns, 1.0, 0.35);
    }
  }
}

TEST(ArrivalScatter, IsUnknownBeforeTheSecondMessage) {
  ArrivalScatter scatter(8'000'000);
  EXPECT_EQ(scatter.sigma_ns(), 0);
  scatter.add(5'000'000'000);
  EXPECT_EQ(scatter.sigma_ns(), 0);
}

TEST(DeviceClock, UncertaintyIsTheScatterOfTheSmallestDelays) {
  const auto sigma_after = [](double scatter_ns) {
    std::mt19937_64 random(9);
    std::exponential_distribution<double> late(1.0);
    std::normal_distribution<double> offset(0.0, scatter_ns);
    DeviceClock clock;
    double window = 0.0;
    for (std::int64_t i = 0; i < 60'000; ++i) {
      if (i % 1000 == 0) window = offset(random);
      const std::int64_t device_ns = i * 1'000'000;
      clock.host_time(device_ns,
                      device_ns + 7'000'000'000 + std::llround(10'000.0 * late(random) + window));
    }
    return static_cast<double>(clock.sigma_ns());
  };
  EXPECT_LT(sigma_after(0.0), 2'000.0);
  const double uncertain = sigma_after(200'000.0);
  EXPECT_GT(uncertain, 60'000.0);
  EXPECT_LT(uncertain, 600'000.0);
  EXPECT_EQ(DeviceClock().sigma_ns(), 0);
}

}  // namespace
}  // namespace stickslip::drivers
