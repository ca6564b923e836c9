// SPDX-License-Identifier: Apache-2.0
#include "daemon/deadline.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace stickslip::daemon {
namespace {

constexpr std::int64_t ms = 1'000'000;

TEST(Deadline, IsOnePeriodLaterIfInTime) {
  EXPECT_EQ(next_deadline(10 * ms, ms, 10 * ms + 1), (Deadline{11 * ms, 0, 0}));
  EXPECT_EQ(next_deadline(10 * ms, ms, 11 * ms), (Deadline{11 * ms, 0, 0}));
}

TEST(Deadline, IsNotSkippedIfLessThanAPeriodLate) {
  EXPECT_EQ(next_deadline(10 * ms, ms, 11 * ms + 300), (Deadline{11 * ms, 300, 0}));
  EXPECT_EQ(next_deadline(10 * ms, ms, 12 * ms - 1), (Deadline{11 * ms, ms - 1, 0}));
}

TEST(Deadline, WholePeriodsThatPassedAreSkipped) {
  EXPECT_EQ(next_deadline(10 * ms, ms, 12 * ms), (Deadline{12 * ms, ms, 1}));
  EXPECT_EQ(next_deadline(10 * ms, ms, 15 * ms + 7), (Deadline{15 * ms, 4 * ms + 7, 4}));
}

RC_GTEST_PROP(Deadline, KeepsPhaseAndSkipsNoMoreThanNecessary, ()) {
  const std::int64_t period = *rc::gen::inRange<std::int64_t>(1, 10 * ms);
  std::int64_t due = *rc::gen::inRange<std::int64_t>(0, 1'000'000 * ms);
  const std::int64_t origin = due;
  std::int64_t periods = 0;
  for (const std::int64_t work :
       *rc::gen::container<std::vector<std::int64_t>>(rc::gen::inRange<std::int64_t>(0, 50 * ms))) {
    const std::int64_t now = due + work;
    const Deadline next = next_deadline(due, period, now);
    RC_ASSERT((next.due_ns - origin) % period == 0);
    RC_ASSERT(next.due_ns > due);
    RC_ASSERT(next.due_ns > now - period);                  // never a whole period behind
    RC_ASSERT(next.due_ns <= std::max(now, due + period));  // never later than it must be
    RC_ASSERT((next.late_ns > 0) == (now > due + period));
    periods += 1 + next.skipped;
    due = next.due_ns;
    RC_ASSERT(due == origin + periods * period);
  }
}

}  // namespace
}  // namespace stickslip::daemon
