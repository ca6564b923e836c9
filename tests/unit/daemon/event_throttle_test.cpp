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

TEST(EventThrottle, ReportsTheFirstImmediatelyAndTheRestOnceASecondWithACount) {
  EventThrottle throttle;
  std::vector<Event> reported;
  // Every other frame of 1 kHz for 2.5 s.
  for (std::int64_t t = 0; t < 2500; t += 2) {
    Notice gap = notice(Notice::Kind::frames_missing, 1);
    gap.sequence = static_cast<std::uint64_t>(t);
    if (const auto event = throttle.accept(gap, t * ms)) reported.push_back(*event);
    for (Event& event : throttle.due(t * ms)) reported.push_back(std::move(event));
  }
  for (Event& event : throttle.flush()) reported.push_back(std::move(event));
  ASSERT_EQ(reported.size(), 4U);
  for (const Event& event : reported) EXPECT_EQ(event.code, "frames_missing");
  EXPECT_EQ(reported[0].message, "the source lost 1 frames");
  EXPECT_EQ(reported[1].message, "the source lost 500 more frames, in 500 gaps");
  EXPECT_EQ(reported[1].sequence, 1000U);  // of the latest
  EXPECT_EQ(reported[2].message, "the source lost 500 more frames, in 500 gaps");
  EXPECT_EQ(reported[3].message, "the source lost 249 more frames, in 249 gaps");
  EXPECT_TRUE(throttle.flush().empty());
}

TEST(EventThrottle, ReportsOccasionalNoticesUnchanged) {
  EventThrottle throttle;
  for (std::int64_t t = 0; t < 10'000; t += 1000) {
    EXPECT_TRUE(throttle.accept(notice(Notice::Kind::sequence_repeated, 7), t * ms));
    EXPECT_TRUE(throttle.due(t * ms).empty());
  }
  EXPECT_FALSE(throttle.accept(notice(Notice::Kind::sequence_repeated, 8), 9500 * ms));
  EXPECT_TRUE(throttle.due(9999 * ms).empty());
  const std::vector<Event> due = throttle.due(10'000 * ms);
  ASSERT_EQ(due.size(), 1U);  // a single notice is reported unchanged
  EXPECT_EQ(due[0].message, event_of(notice(Notice::Kind::sequence_repeated, 8)).message);
}

// A filter that cannot track a rig restarts several times a second.
TEST(EventThrottle, ReportsADivergingObserverOnceASecond) {
  EventThrottle throttle;
  EXPECT_TRUE(throttle.accept(notice(Notice::Kind::estimate_restarted), 0));
  for (std::int64_t t = 200; t < 1000; t += 200) {
    EXPECT_FALSE(throttle.accept(notice(Notice::Kind::estimate_restarted), t * ms));
  }
  const std::vector<Event> due = throttle.due(1000 * ms);
  ASSERT_EQ(due.size(), 1U);
  EXPECT_EQ(due[0].code, "estimate_restarted");
  EXPECT_EQ(due[0].message, "the observer diverged and was restarted, 4 more times");
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
  EXPECT_EQ(due[0].message, "the source's sequence number did not increase, 2 more times");
  EXPECT_EQ(due[1].message, "2 more cycles were late, by up to 9.000 ms, 6 periods skipped");
  EXPECT_TRUE(throttle.due(3000 * ms).empty());
}

}  // namespace
}  // namespace stickslip::daemon
