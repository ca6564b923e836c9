// SPDX-License-Identifier: Apache-2.0
#include "daemon/utc_clock.h"

#include <gtest/gtest.h>

#include <random>

namespace stickslip::daemon {
namespace {

constexpr std::int64_t second_us = 1'000'000;
constexpr std::int64_t start_us = 1'700'000'000 * second_us;

TEST(UtcClock, FollowsAnUndisturbedHostClock) {
  UtcClock clock;
  for (std::int64_t s = 0; s < 100; ++s) {
    EXPECT_EQ(clock.utc_us(s * 1'000'000'000, start_us + s * second_us), start_us + s * second_us);
  }
}

TEST(UtcClock, FollowsAStepForwardAndWaitsForAStepBack) {
  UtcClock clock;
  clock.utc_us(0, start_us);
  EXPECT_EQ(clock.utc_us(1'000'000'000, start_us + 3600 * second_us), start_us + 3600 * second_us);
  // Set back by a tenth of a second: caught up after 200 s.
  std::int64_t before = start_us + 3600 * second_us;
  for (std::int64_t s = 2; s < 400; ++s) {
    const std::int64_t wall = start_us + (3599 + s) * second_us - second_us / 10;
    const std::int64_t now = clock.utc_us(s * 1'000'000'000, wall);
    EXPECT_GT(now, before);
    EXPECT_LE(now - wall, second_us / 10);
    before = now;
    if (s > 250) {
      EXPECT_EQ(now, wall);
    }
  }
}

TEST(UtcClock, NeverRunsBackwardsWithAnyStepsOfTheHostClock) {
  std::mt19937_64 random(5);
  UtcClock clock;
  std::int64_t monotonic_ns = 0;
  std::int64_t wall_us = start_us;
  std::int64_t before = 0;
  for (int i = 0; i < 10'000; ++i) {
    const auto step = static_cast<std::int64_t>(random() % 1'000'000'000);
    monotonic_ns += step;
    wall_us += step / 1000;
    if (random() % 20 == 0) wall_us += static_cast<std::int64_t>(random() % 7200) * second_us;
    if (random() % 20 == 0) wall_us -= static_cast<std::int64_t>(random() % 7200) * second_us;
    const std::int64_t now = clock.utc_us(monotonic_ns, wall_us);
    ASSERT_GE(now, before);
    before = now;
  }
}

}  // namespace
}  // namespace stickslip::daemon
