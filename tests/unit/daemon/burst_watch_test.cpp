#include "daemon/burst_watch.h"

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

TEST(BurstWatch, TheFirstIsToldAtOnceAndTheRestOnceASecondWithACount) {
  BurstWatch watch;
  std::vector<Event> told;
  // Every other frame of 1 kHz for 2.5 s.
  for (std::int64_t t = 0; t < 2500; t += 2) {
    Notice gap = notice(Notice::Kind::frames_missing, 1);
    gap.sequence = static_cast<std::uint64_t>(t);
    if (const auto event = watch.take(gap, t * ms)) told.push_back(*event);
    for (Event& event : watch.due(t * ms)) told.push_back(std::move(event));
  }
  for (Event& event : watch.rest()) told.push_back(std::move(event));
  ASSERT_EQ(told.size(), 4U);
  for (const Event& event : told) EXPECT_EQ(event.code, "frames_missing");
  EXPECT_EQ(told[0].message, "the source lost 1 frames");
  EXPECT_EQ(told[1].message, "the source lost 500 frames more, in 500 gaps");
  EXPECT_EQ(told[1].sequence, 1000U);  // of the latest
  EXPECT_EQ(told[2].message, "the source lost 500 frames more, in 500 gaps");
  EXPECT_EQ(told[3].message, "the source lost 249 frames more, in 249 gaps");
  EXPECT_TRUE(watch.rest().empty());
}

TEST(BurstWatch, WhatComesNowAndThenIsToldAsWhatItIs) {
  BurstWatch watch;
  for (std::int64_t t = 0; t < 10'000; t += 1000) {
    EXPECT_TRUE(watch.take(notice(Notice::Kind::sequence_repeated, 7), t * ms));
    EXPECT_TRUE(watch.due(t * ms).empty());
  }
  EXPECT_FALSE(watch.take(notice(Notice::Kind::sequence_repeated, 8), 9500 * ms));
  EXPECT_TRUE(watch.due(9999 * ms).empty());
  const std::vector<Event> due = watch.due(10'000 * ms);
  ASSERT_EQ(due.size(), 1U);  // a single one in its own words
  EXPECT_EQ(due[0].message, event_of(notice(Notice::Kind::sequence_repeated, 8)).message);
}

// A filter that cannot follow a rig begins anew several times a second.
TEST(BurstWatch, AnObserverThatCannotFollowIsToldOnceASecond) {
  BurstWatch watch;
  EXPECT_TRUE(watch.take(notice(Notice::Kind::estimate_restarted), 0));
  for (std::int64_t t = 200; t < 1000; t += 200) {
    EXPECT_FALSE(watch.take(notice(Notice::Kind::estimate_restarted), t * ms));
  }
  const std::vector<Event> due = watch.due(1000 * ms);
  ASSERT_EQ(due.size(), 1U);
  EXPECT_EQ(due[0].code, "estimate_restarted");
  EXPECT_EQ(due[0].message, "the observer diverged and began anew, 4 times more");
}

TEST(BurstWatch, KindsDoNotHideEachOtherAndFaultsAreNeverHeldBack) {
  BurstWatch watch;
  EXPECT_TRUE(watch.take(notice(Notice::Kind::frames_missing), 0));
  EXPECT_TRUE(watch.take(notice(Notice::Kind::sequence_repeated), 0));
  EXPECT_TRUE(watch.take(notice(Notice::Kind::overrun, 3, 5 * ms), 0));
  EXPECT_FALSE(watch.take(notice(Notice::Kind::overrun, 2, 9 * ms), ms));
  EXPECT_FALSE(watch.take(notice(Notice::Kind::overrun, 4, 6 * ms), 2 * ms));
  EXPECT_FALSE(watch.take(notice(Notice::Kind::sequence_repeated), 3 * ms));
  EXPECT_FALSE(watch.take(notice(Notice::Kind::sequence_repeated), 4 * ms));
  for (int i = 0; i < 10; ++i) {
    EXPECT_TRUE(watch.take(notice(Notice::Kind::fault), 5 * ms));
    EXPECT_TRUE(watch.take(notice(Notice::Kind::state), 5 * ms));
  }
  const std::vector<Event> due = watch.due(1000 * ms);
  ASSERT_EQ(due.size(), 2U);
  EXPECT_EQ(due[0].message, "the source's sequence number did not grow, 2 times more");
  EXPECT_EQ(due[1].message, "2 cycles more came late, by up to 9.000 ms, 6 periods skipped");
  EXPECT_TRUE(watch.due(3000 * ms).empty());
}

}  // namespace
}  // namespace stickslip::daemon
