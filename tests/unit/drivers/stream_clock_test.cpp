// SPDX-License-Identifier: Apache-2.0
#include "drivers/clock/stream_clock.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace stickslip::drivers {
namespace {

constexpr std::int64_t us = 1'000;
constexpr std::int64_t ms = 1'000'000;
constexpr std::int64_t start_ns = 3'600'000 * ms;  // of the stream, on the host's clock
constexpr std::int64_t latency_ns = 700 * us;      // from the last scan of a packet to the host

/// A board that measures at a period and sends packets, and a reader of it.
struct Stream {
  std::int64_t period_ns = ms;
  std::int64_t scans_per_packet = 5;
  std::int64_t first_read_ns = 0;  // after the start of the stream

  /// The first frames, each read as early as possible, 5 us after the one before.
  std::vector<Frame> frames(StreamClock& clock, std::int64_t count) const {
    std::vector<Frame> out;
    std::int64_t now_ns = start_ns + first_read_ns;
    for (std::int64_t i = 0; i < count; ++i) {
      const std::int64_t last = (i / scans_per_packet + 1) * scans_per_packet - 1;
      now_ns = std::max(now_ns + 5 * us, start_ns + last * period_ns + latency_ns);
      Frame frame;
      frame.sequence = static_cast<std::uint64_t>(i);
      frame.time_ns = i * period_ns;
      clock.take(frame, now_ns);
      while (clock.next(frame)) out.push_back(frame);
    }
    return out;
  }
};

void expect_times_of(const std::vector<Frame>& frames, const Stream& stream) {
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const auto scan = static_cast<std::int64_t>(i);
    ASSERT_EQ(frames[i].sequence, i);
    // The transport is not known; the reader's pace within a packet adds to it.
    const std::int64_t late_ns = frames[i].time_ns - start_ns - scan * stream.period_ns;
    ASSERT_GE(late_ns, 0);
    ASSERT_LE(late_ns, latency_ns + stream.scans_per_packet * 5 * us) << i;
  }
}

TEST(StreamClock, FirstFramesHaveTheTimesAtWhichTheyWereMeasured) {
  for (const std::int64_t scans_per_packet : {1, 5, 12}) {
    for (const std::int64_t first_read_ms : {0, 3, 40, 43, 125}) {
      SCOPED_TRACE(testing::Message()
                   << scans_per_packet << " scans, read after " << first_read_ms << " ms");
      const Stream stream{ms, scans_per_packet, first_read_ms * ms};
      StreamClock clock;
      const auto frames = stream.frames(clock, 600);
      ASSERT_GT(frames.size(), 580U);
      expect_times_of(frames, stream);
      EXPECT_EQ(clock.restarts(), 0U);
    }
  }
}

TEST(StreamClock, SlowBoardsAreHeldBrieflyOnly) {
  const Stream stream{5 * ms, 1, 125 * ms};
  StreamClock clock;
  const auto frames = stream.frames(clock, 40);
  EXPECT_EQ(frames.size(), 40U);
  expect_times_of(frames, stream);
}

// A reader that is interrupted in the burst has not caught up.
TEST(StreamClock, InterruptionInTheBurstIsNotItsEnd) {
  StreamClock clock;
  std::vector<Frame> out;
  std::int64_t now_ns = start_ns + 60 * ms;
  for (std::int64_t i = 0; i < 200; ++i) {
    const std::int64_t last = i / 5 * 5 + 4;
    now_ns = std::max(now_ns + 5 * us, start_ns + last * ms + latency_ns);
    if (i % 10 == 7 && i < 40) now_ns += 2 * ms;
    Frame frame;
    frame.sequence = static_cast<std::uint64_t>(i);
    frame.time_ns = i * ms;
    clock.take(frame, now_ns);
    while (clock.next(frame)) out.push_back(frame);
  }
  expect_times_of(out, Stream{});
}

TEST(StreamClock, AReadInVainEndsTheHold) {
  StreamClock clock;
  Frame frame;
  frame.time_ns = 0;
  clock.found_nothing();
  EXPECT_FALSE(clock.next(frame));
  clock.take(frame, start_ns + 125 * ms);
  frame.time_ns = 125 * ms;
  clock.take(frame, start_ns + 125 * ms + 5 * us);
  Frame placed;
  EXPECT_FALSE(clock.next(placed));
  clock.found_nothing();
  ASSERT_TRUE(clock.next(placed));
  EXPECT_EQ(placed.time_ns, start_ns + 5 * us);
  ASSERT_TRUE(clock.next(placed));
  EXPECT_EQ(placed.time_ns, start_ns + 125 * ms + 5 * us);
  EXPECT_FALSE(clock.next(placed));
}

TEST(StreamClock, ARestartedStreamBeginsAnew) {
  StreamClock clock;
  Frame frame;
  clock.take(frame, start_ns + 40 * ms);  // held when the board was lost
  for (int stream_number = 0; stream_number < 2; ++stream_number) {
    clock.restart();
    const Stream stream{ms, 5, 40 * ms};
    expect_times_of(stream.frames(clock, 300), stream);
  }
}

}  // namespace
}  // namespace stickslip::drivers
