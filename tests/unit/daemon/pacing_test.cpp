// SPDX-License-Identifier: Apache-2.0
#include "daemon/pacing.h"

#include <gtest/gtest.h>

#include "drivers/driver.h"
#include "tests/unit/daemon/fakes.h"

namespace stickslip::daemon {
namespace {

constexpr std::int64_t ms = 1'000'000;

PacerSettings with(Pacing pacing) {
  return {.pacing = pacing, .period_ns = ms, .lateness_limit_ns = ms, .detect_stalls = true};
}

TEST(Pacer, SleepsUntilItsDeadlinesAndKeepsTheirGridThroughAnOverrun) {
  test::FakeClock clock;
  Pacer pacer(clock, with(Pacing::deadlines));
  const std::int64_t origin_ns = clock.now;
  pacer.start(origin_ns);
  Wakeup wakeup = pacer.wait(true);
  EXPECT_EQ(clock.now, origin_ns + ms);
  EXPECT_EQ(wakeup.elapsed_ns, ms);
  EXPECT_EQ(wakeup.lateness_ns, 0);
  EXPECT_FALSE(wakeup.late);

  clock.now += 3 * ms + 200'000;
  wakeup = pacer.wait(true);
  EXPECT_EQ(wakeup.overrun_ns, 2 * ms + 200'000);
  EXPECT_EQ(wakeup.skipped, 2);
  EXPECT_EQ(wakeup.elapsed_ns, 3 * ms);
  EXPECT_EQ(wakeup.lateness_ns, 200'000);
  EXPECT_TRUE(wakeup.late);
  pacer.wait(true);
  EXPECT_EQ((clock.now - origin_ns) % ms, 0);
  EXPECT_TRUE(pacer.has_deadlines());
  EXPECT_FALSE(pacer.waits_for_consumers());
}

TEST(Pacer, TheFirstCycleHasNoDeadlineToMiss) {
  test::FakeClock clock;
  Pacer pacer(clock, with(Pacing::deadlines));
  pacer.start(clock.now - 10 * ms);
  const Wakeup wakeup = pacer.wait(true);
  EXPECT_EQ(wakeup.overrun_ns, 0);
  EXPECT_EQ(wakeup.skipped, 0);
}

TEST(Pacer, AWakeUpBeyondTheLimitIsLateWithoutAnOverrun) {
  test::FakeClock clock;
  clock.oversleep_ns = ms + 1;
  Pacer pacer(clock, with(Pacing::deadlines));
  pacer.start(clock.now);
  const Wakeup wakeup = pacer.wait(true);
  EXPECT_EQ(wakeup.overrun_ns, 0);
  EXPECT_EQ(wakeup.lateness_ns, ms + 1);
  EXPECT_TRUE(wakeup.late);
}

TEST(Pacer, LeavesTheWaitingToTheDriverAndReportsAStall) {
  test::FakeClock clock;
  Pacer pacer(clock, with(Pacing::driver));
  pacer.start(clock.now);
  const std::int64_t before_ns = clock.now;
  EXPECT_FALSE(pacer.wait(true).late);
  EXPECT_EQ(clock.now, before_ns);
  clock.now += drivers::longest_paced_wait_ns + ms;
  EXPECT_FALSE(pacer.wait(true).late);
  clock.now += drivers::longest_paced_wait_ns + 7 * ms;
  const Wakeup stalled = pacer.wait(true);
  EXPECT_TRUE(stalled.late);
  EXPECT_EQ(stalled.overrun_ns, 7 * ms);
  EXPECT_FALSE(stalled.lateness_ns);
}

TEST(Pacer, SleepsOnePeriodWhileADriverThatPacesIsAbsent) {
  for (const Pacing pacing : {Pacing::driver, Pacing::free_running}) {
    test::FakeClock clock;
    Pacer pacer(clock, with(pacing));
    const std::int64_t before_ns = clock.now;
    pacer.wait(false);
    EXPECT_EQ(clock.now, before_ns + ms);
    clock.now += 1000 * ms;
    EXPECT_FALSE(pacer.wait(true).late) << "the absence is not a stall";
  }
}

TEST(Pacer, FreeRunningNeitherSleepsNorLosesFrames) {
  test::FakeClock clock;
  Pacer pacer(clock, with(Pacing::free_running));
  const std::int64_t before_ns = clock.now;
  for (int i = 0; i < 100; ++i) pacer.wait(true);
  EXPECT_EQ(clock.now, before_ns);
  EXPECT_TRUE(pacer.waits_for_consumers());
  EXPECT_FALSE(pacer.has_deadlines());
}

}  // namespace
}  // namespace stickslip::daemon
