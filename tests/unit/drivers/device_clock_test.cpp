// SPDX-License-Identifier: Apache-2.0
#include "drivers/clock/device_clock.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>

namespace stickslip::drivers {
namespace {

constexpr std::int64_t ms = 1'000'000;
constexpr std::int64_t s = 1'000'000'000;

struct Rates {
  double skew;
  double latest_error_us;
};

/// A device that samples every millisecond of its own time, read by the host after `delay`.
Rates run(double skew, std::uint32_t seed, int seconds) {
  std::mt19937 random(seed);
  std::exponential_distribution<double> wait(1.0 / 80e3);  // 80 us on average, occasionally ms
  DeviceClock clock;
  std::int64_t previous = 0;
  double worst = 0.0;
  for (std::int64_t i = 0; i < std::int64_t{1000} * seconds; ++i) {
    const std::int64_t device_ns = 123 * s + i * ms;
    const double true_ns = 5e9 + static_cast<double>(i * ms) * (1.0 + skew);
    const auto host_ns = static_cast<std::int64_t>(true_ns + 20e3 + wait(random));
    const std::int64_t out = clock.host_time(device_ns, host_ns);
    EXPECT_GT(out, previous);
    previous = out;
    if (i > 8000) worst = std::max(worst, std::abs(static_cast<double>(out) - true_ns - 20e3));
  }
  EXPECT_EQ(clock.restarts(), 0U);
  return {clock.skew(), worst * 1e-3};
}

TEST(DeviceClock, EstimatesTheSkewOfACrystalDespiteJitter) {
  for (const double skew : {0.0, 50e-6, -50e-6, 300e-6}) {
    for (std::uint32_t seed = 1; seed <= 4; ++seed) {
      const Rates found = run(skew, seed, 60);
      EXPECT_NEAR(found.skew, skew, 3e-6) << skew;
      EXPECT_LT(found.latest_error_us, 25.0) << skew;
    }
  }
}

TEST(DeviceClock, SkewIsClamped) {
  DeviceClock clock;
  for (std::int64_t i = 0; i < 20'000; ++i) {
    clock.host_time(i * ms, s + i * (ms + 2000));  // 2000 parts in a million
    ASSERT_LE(std::abs(clock.skew()), DeviceClock::largest_skew);
  }
}

TEST(DeviceClock, TimeIncreasesStrictlyWhateverHappens) {
  std::mt19937_64 random(7);
  for (int run = 0; run < 50; ++run) {
    DeviceClock clock;
    std::int64_t device_ns = 0;
    std::int64_t host_ns = s;
    std::int64_t previous = 0;
    for (int i = 0; i < 2000; ++i) {
      const auto roll = random() % 500;
      device_ns += ms;
      host_ns += ms;
      if (roll == 0) device_ns -= static_cast<std::int64_t>(random() % (10 * s));  // restarted
      if (roll == 1) device_ns += static_cast<std::int64_t>(random() % (10 * s));  // stepped
      if (roll == 2) host_ns += static_cast<std::int64_t>(random() % (10 * s));    // was suspended
      if (roll == 3) device_ns += 3600 * s;  // the host was suspended, the device was not
      const std::int64_t out = clock.host_time(device_ns, host_ns);
      ASSERT_GT(out, previous);
      previous = out;
    }
    // After the last disturbance it is the host's time again.
    for (int i = 0; i < 30'000; ++i) {
      device_ns += ms;
      host_ns += ms;
      previous = clock.host_time(device_ns, host_ns);
    }
    EXPECT_LE(previous - host_ns, DeviceClock::restart_threshold_ns);
  }
}

TEST(DeviceClock, SuspendedHostRestartsTheEstimate) {
  DeviceClock clock;
  std::int64_t out = 0;
  for (std::int64_t i = 0; i < 5000; ++i) out = clock.host_time(i * ms, s + i * ms);
  EXPECT_EQ(clock.restarts(), 0U);
  // The monotonic clock stops while the host is suspended for an hour.
  for (std::int64_t i = 5000; i < 6000; ++i) {
    const std::int64_t next = clock.host_time(3600 * s + i * ms, s + i * ms);
    ASSERT_GT(next, out);
    out = next;
  }
  EXPECT_EQ(clock.restarts(), 1U);
  EXPECT_NEAR(static_cast<double>(out), static_cast<double>(s + 5999 * ms), 1e3);
}

TEST(DeviceClock, LateReadsDoNotShiftTheTimeOfSamples) {
  DeviceClock clock;
  for (std::int64_t i = 0; i < 5000; ++i) clock.host_time(i * ms, s + i * ms);
  // The process was stopped for 300 ms; the samples wait in the device's buffer.
  for (std::int64_t i = 5000; i < 5300; ++i) {
    EXPECT_NEAR(static_cast<double>(clock.host_time(i * ms, s + 5300 * ms)),
                static_cast<double>(s + i * ms), 2e5);
  }
  EXPECT_EQ(clock.restarts(), 0U);
}

}  // namespace
}  // namespace stickslip::drivers
