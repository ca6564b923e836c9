// SPDX-License-Identifier: Apache-2.0
#include "daemon/event_throttle.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace stickslip::daemon {
namespace {

constexpr std::int64_t ms = 1'000'000;

Notice notice(Notice::Kind kind, std::uint64_t count = 1, std::int64_t duration_ns = 0) {
  Notice out;
  out.kind = kind;
  out.count = count;
  out.duration_ns = duration_ns;
  return out;
}

/// A notice every `step` ms for a while; what is reported, with the time [ms] of each.
std::vector<std::pair<std::int64_t, Event>> reports(EventThrottle& throttle, const Notice& notice,
                                                    std::int64_t step, std::int64_t last) {
  std::vector<std::pair<std::int64_t, Event>> out;
  for (std::int64_t t = 0; t <= last; t += step) {
    if (const auto event = throttle.accept(notice, t * ms)) out.emplace_back(t, *event);
    for (Event& event : throttle.due(t * ms)) out.emplace_back(t, std::move(event));
  }
  return out;
}

TEST(EventThrottle, ReportsTheFirstImmediatelyAndTheRestEverMoreRarelyWithItsCount) {
  EventThrottle throttle;
  const auto reported = reports(throttle, notice(Notice::Kind::frames_missing, 1), 2, 5000);
  ASSERT_EQ(reported.size(), 3U);
  for (const auto& [t, event] : reported) EXPECT_EQ(event.code, "frames_missing");
  EXPECT_EQ(reported[0].second.message, "the source lost 1 frames");
  EXPECT_EQ(reported[1].first, 1000);
  EXPECT_EQ(reported[1].second.message, "the source lost 500 more frames, in 500 gaps");
  EXPECT_EQ(reported[2].first, 3000);
  EXPECT_EQ(reported[2].second.message, "the source lost 1000 more frames, in 1000 gaps");
  const std::vector<Event> last = throttle.flush();
  ASSERT_EQ(last.size(), 1U);
  EXPECT_EQ(last[0].message, "the source lost 1000 more frames, in 1000 gaps");
  EXPECT_TRUE(throttle.flush().empty());
}

TEST(EventThrottle, AnHourOfAnyRepeatedNoticeIsALineAMinute) {
  for (const std::int64_t step : {100, 1000, 2500}) {
    EventThrottle throttle;
    const auto reported = reports(throttle, notice(Notice::Kind::read_failed), step, 3'600'000);
    EXPECT_LT(reported.size(), 70U) << step;
    EXPECT_GT(reported.size(), 60U) << step;
  }
}

TEST(EventThrottle, TheEndOfABurstIsALineAndTheNextOneBeginsAnew) {
  EventThrottle throttle;
  Notice loose = notice(Notice::Kind::not_finite, 2);
  EXPECT_EQ(reports(throttle, loose, 10, 4000).size(), 3U);
  EXPECT_TRUE(throttle.due(6999 * ms).empty());
  EXPECT_EQ(throttle.due(7000 * ms).size(), 1U);
  EXPECT_FALSE(throttle.accept(loose, 7500 * ms));
  EXPECT_FALSE(throttle.accept(loose, 7501 * ms));
  EXPECT_TRUE(throttle.due(14'999 * ms).empty());
  EXPECT_EQ(throttle.due(15'000 * ms).size(), 1U);
  EXPECT_FALSE(throttle.accept(loose, 15'001 * ms));
  EXPECT_FALSE(throttle.accept(loose, 15'002 * ms));
  const std::vector<Event> over = throttle.due(25'002 * ms);
  ASSERT_EQ(over.size(), 1U);
  EXPECT_THAT(over[0].message, testing::HasSubstr("friction_force is not a finite number; invalid "
                                                  "until it is, 2 more times; none for 10 s"));
  EXPECT_TRUE(throttle.accept(loose, 25'003 * ms));
}

TEST(EventThrottle, ReportsOccasionalNoticesUnchanged) {
  EventThrottle throttle;
  for (std::int64_t t = 0; t < 100'000; t += 10'000) {
    EXPECT_TRUE(throttle.accept(notice(Notice::Kind::sequence_repeated, 7), t * ms));
    EXPECT_TRUE(throttle.due(t * ms).empty());
  }
  EXPECT_FALSE(throttle.accept(notice(Notice::Kind::sequence_repeated, 8), 90'500 * ms));
  EXPECT_TRUE(throttle.due(90'999 * ms).empty());
  const std::vector<Event> due = throttle.due(91'000 * ms);
  ASSERT_EQ(due.size(), 1U);  // a single notice is reported unchanged
  EXPECT_EQ(due[0].message, event_of(notice(Notice::Kind::sequence_repeated, 8)).message);
}

TEST(EventThrottle, OneChannelDoesNotHideAnother) {
  EventThrottle throttle;
  EXPECT_TRUE(throttle.accept(notice(Notice::Kind::not_finite, 0), 0));
  EXPECT_TRUE(throttle.accept(notice(Notice::Kind::not_finite, 1), 0));
  EXPECT_FALSE(throttle.accept(notice(Notice::Kind::not_finite, 1), ms));
}

TEST(EventThrottle, AnAllowanceIsRegained) {
  EventThrottle throttle;
  const Event line{Severity::info, "control", "user 0: arm"};
  const Allowance allowance{.reports = 20.0, .per_second = 2.0};
  // An operator's pace for an hour.
  for (std::int64_t t = 0; t < 3'600'000; t += 500) {
    ASSERT_TRUE(throttle.accept(line, t * ms, allowance)) << t;
  }
  // A program that repeats itself.
  std::size_t lines = 0;
  for (std::int64_t t = 3'600'000; t < 3'610'000; ++t) {
    lines += throttle.accept(line, t * ms, allowance) ? 1 : 0;
    lines += throttle.due(t * ms).size();
  }
  EXPECT_LT(lines, 60U);
  const std::vector<Event> last = throttle.flush();
  ASSERT_EQ(last.size(), 1U);
  EXPECT_THAT(last[0].message, testing::ContainsRegex("user 0: arm; [0-9]+ such since"));
}

TEST(EventThrottle, ThrottlesEachKindSeparatelyAndNeverFaults) {
  EventThrottle throttle;
  EXPECT_TRUE(throttle.accept(notice(Notice::Kind::frames_missing), 0));
  EXPECT_TRUE(throttle.accept(notice(Notice::Kind::sequence_repeated), 0));
  EXPECT_TRUE(throttle.accept(notice(Notice::Kind::overrun, 3, 5 * ms), 0));
  EXPECT_FALSE(throttle.accept(notice(Notice::Kind::overrun, 2, 9 * ms), ms));
  EXPECT_FALSE(throttle.accept(notice(Notice::Kind::overrun, 4, 6 * ms), 2 * ms));
  EXPECT_FALSE(throttle.accept(notice(Notice::Kind::sequence_repeated), 3 * ms));
  EXPECT_FALSE(throttle.accept(notice(Notice::Kind::sequence_repeated), 4 * ms));
  for (int i = 0; i < 10; ++i) {
    EXPECT_TRUE(throttle.accept(notice(Notice::Kind::fault), 5 * ms));
    EXPECT_TRUE(throttle.accept(notice(Notice::Kind::state), 5 * ms));
  }
  const std::vector<Event> due = throttle.due(1000 * ms);
  ASSERT_EQ(due.size(), 2U);
  EXPECT_EQ(due[0].message, "2 more cycles were late, by up to 9.000 ms, 6 periods skipped");
  EXPECT_EQ(due[1].message, "the source's sequence number did not increase, 2 more times");
  EXPECT_TRUE(throttle.due(3000 * ms).empty());
}

}  // namespace
}  // namespace stickslip::daemon
