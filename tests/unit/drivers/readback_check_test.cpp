// SPDX-License-Identifier: Apache-2.0
#include "drivers/bench/readback_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "config/readback.h"

namespace stickslip::drivers {
namespace {

constexpr std::int64_t ms = 1'000'000;
constexpr ReadbackCheck::Settings settings{100 * ms, 0.05};

double drive(std::int64_t time_ns, double hz) {
  return 2.5 + 1.3 * std::sin(2.0 * std::numbers::pi * hz * 1e-9 * static_cast<double>(time_ns));
}

using Output = std::function<double(std::int64_t time_ns)>;

/// Runs at 1 kHz; the time from 1 s on until it differs [ns], or -1.
std::int64_t found_ns(const Output& command, const Output& reading, double seconds = 4.0) {
  ReadbackCheck check(settings);
  const std::int64_t begin = 5'000'000 * ms;
  for (std::int64_t t = 0; t < std::llround(1e9 * seconds); t += ms) {
    check.command(command(t), begin + t);
    check.reading(reading(t), begin + t);
    if (check.differs()) return t - 1000 * ms;
  }
  return -1;
}

// Frequencies whose periods are shorter than the delay are the ones that a window of commands
// alone could not distinguish from an output that is stuck.
TEST(ReadbackCheck, FollowingOutputAgreesAtEveryFrequencyAndDelay) {
  for (const double hz : {0.1, 1.0, 3.2, 7.0, 20.0}) {
    for (const std::int64_t delay : {0 * ms, 5 * ms, 60 * ms, 95 * ms}) {
      const Output command = [hz](std::int64_t t) { return drive(t, hz); };
      const Output reading = [hz, delay](std::int64_t t) {
        return t < delay ? 2.5 : drive(t - delay, hz);
      };
      EXPECT_EQ(found_ns(command, reading), -1) << hz << " Hz, " << delay;
    }
  }
}

TEST(ReadbackCheck, StuckOutputIsFoundWithinThreeDelaysOfItsNextMotion) {
  for (const double hz : {1.0, 3.2, 7.0, 20.0}) {
    const Output command = [hz](std::int64_t t) { return drive(t, hz); };
    const Output stuck = [hz](std::int64_t t) { return drive(std::min(t, 1000 * ms), hz); };
    const std::int64_t found = found_ns(command, stuck);
    EXPECT_GE(found, 0) << hz;
    EXPECT_LE(found, 3 * settings.longest_delay_ns + std::llround(0.25e9 / hz)) << hz;
  }
}

TEST(ReadbackCheck, OutputThatRestsWhileItIsDrivenIsFound) {
  const Output command = [](std::int64_t t) { return t < 1000 * ms ? 2.5 : drive(t, 5.0); };
  const std::int64_t found = found_ns(command, [](std::int64_t) { return 2.5; });
  EXPECT_GE(found, 0);
  EXPECT_LE(found, 3 * settings.longest_delay_ns);
}

TEST(ReadbackCheck, OutputThatMovesWithoutACommandIsFound) {
  const Output rest = [](std::int64_t) { return 2.5; };
  const std::int64_t found =
      found_ns(rest, [](std::int64_t t) { return t < 1000 * ms ? 2.5 : 2.6; });
  EXPECT_GE(found, 0);
  EXPECT_LE(found, 3 * settings.longest_delay_ns);
}

TEST(ReadbackCheck, ContactThatWeldsIsFoundOnceItIsSwitchedOff) {
  const Output command = [](std::int64_t t) { return t < 1000 * ms ? 1.0 : 0.0; };
  const std::int64_t found = found_ns(command, [](std::int64_t) { return 1.0; });
  EXPECT_GE(found, 0);
  EXPECT_LE(found, 3 * settings.longest_delay_ns);
}

TEST(ReadbackCheck, SpikesNoiseAndGapsDoNotCount) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0.0, 0.01);
  ReadbackCheck check(settings);
  for (std::int64_t t = 0; t < 20'000 * ms; t += ms) {
    check.command(drive(t, 3.2), t);
    const bool spike = t % (700 * ms) == 0;
    const bool gap = t % (3000 * ms) > 2500 * ms;
    if (!gap) check.reading((spike ? 9.0 : drive(t - 4 * ms, 3.2)) + noise(random), t);
    ASSERT_FALSE(check.differs()) << t / ms;
  }
}

// A loop that was late: its board's scans come later, with their own times.
TEST(ReadbackCheck, LateReadingsAreComparedWithTheCommandsOfTheirTime) {
  ReadbackCheck check(settings);
  for (std::int64_t t = 0; t < 10'000 * ms; t += ms) {
    check.command(drive(t, 2.0), t);
    const bool late = t % (1000 * ms) >= 900 * ms;
    if (late) continue;
    if (t % (1000 * ms) == 0) {
      for (std::int64_t back = t - 100 * ms; back < t; back += ms) {
        if (back > 0) check.reading(drive(back - 4 * ms, 2.0), back);
      }
    }
    check.reading(drive(t - 4 * ms, 2.0), t);
    ASSERT_FALSE(check.differs()) << t / ms;
  }
}

TEST(ReadbackCheck, NothingIsKnownBeforeTheFirstCommandAndAfterARestart) {
  ReadbackCheck check(settings);
  for (std::int64_t t = 0; t < 2000 * ms; t += ms) check.reading(7.0, t);
  EXPECT_FALSE(check.differs());
  for (std::int64_t t = 2000 * ms; t < 4000 * ms; t += ms) {
    check.command(2.5, t);
    check.reading(7.0, t);
  }
  EXPECT_TRUE(check.differs());
  EXPECT_NEAR(check.difference().reading, 7.0, 1e-9);
  EXPECT_EQ(check.difference().low, 2.5);
  check.restart();
  EXPECT_FALSE(check.differs());
}

TEST(ReadbackLimits, FollowFromTheDeclaredQuantities) {
  config::Bench bench;
  bench.shaker = {150.0, 2.5, 0.0, 5.0};
  bench.readback.drive.emplace();
  bench.readback.enable.emplace();
  const config::ReadbackLimits plain = config::drive_readback_limits(bench, 1000.0);
  EXPECT_NEAR(plain.delay_s, 0.05 + 0.01 + 0.05, 1e-12);
  EXPECT_NEAR(plain.tolerance_v, 0.05 + 2 * 5.0 / 4096 + 0.01, 1e-12);
  bench.readback.longest_overrun_s = 0.2;
  EXPECT_NEAR(config::drive_readback_limits(bench, 1000.0).delay_s, 0.26, 1e-12);
  EXPECT_GT(config::enable_readback_limits(bench, 1000.0).delay_s, 0.3);
  bench.readback.drive->delay_s = 0.02;
  bench.readback.drive->tolerance_v = 0.3;
  EXPECT_NEAR(config::drive_readback_limits(bench, 1000.0).delay_s, 0.02, 1e-12);
  EXPECT_EQ(config::drive_readback_limits(bench, 1000.0).tolerance_v, 0.3);
  EXPECT_NEAR(config::drive_readback_limits(bench, 100.0).delay_s, 0.16, 1e-12);
}

}  // namespace
}  // namespace stickslip::drivers
