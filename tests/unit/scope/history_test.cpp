// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/history.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "messages.h"

namespace stickslip::scope {
namespace {

using test::frame_at;
using test::frames_from;
using test::read_block;

constexpr std::size_t plenty = std::size_t{1} << 30U;

std::vector<std::int64_t> sequences_of(const FrameHistory& history) {
  std::vector<std::int64_t> out;
  for (const SharedMessage& message : history.messages()) {
    const auto block = read_block(*message);
    EXPECT_EQ(block.flags & 2U, 2U) << "not marked as history";
    out.insert(out.end(), block.sequence.begin(), block.sequence.end());
  }
  return out;
}

RC_GTEST_PROP(FrameHistory, HoldsTheLatestFramesInOrderAndAtLeastItsLength, ()) {
  const double length_s = *rc::gen::inRange(1, 4);
  FrameHistory history(length_s, plenty);
  std::uint64_t next = 1;
  const auto blocks =
      *rc::gen::container<std::vector<std::size_t>>(60, rc::gen::inRange<std::size_t>(1, 300));
  for (const std::size_t size : blocks) {
    history.add(frames_from(next, size), *rc::gen::weightedElement<bool>({{20, false}, {1, true}}),
                0.0);
    next += size;
  }
  const auto held = sequences_of(history);
  RC_ASSERT(!held.empty());
  RC_ASSERT(held.back() == static_cast<std::int64_t>(next - 1));
  for (std::size_t i = 1; i < held.size(); ++i) RC_ASSERT(held[i] == held[i - 1] + 1);
  const auto wanted = std::min<std::size_t>(next - 1, static_cast<std::size_t>(1000.0 * length_s));
  RC_ASSERT(held.size() >= wanted);
  RC_ASSERT(held.size() <= wanted + FrameHistory::chunk_frames);
}

TEST(FrameHistory, FullChunksAreEncodedOnceAndShared) {
  FrameHistory history(60.0, plenty);
  history.add(frames_from(1, 2500), false, 7.0);
  const auto first = history.messages();
  const auto second = history.messages();
  ASSERT_EQ(first.size(), 3U);
  EXPECT_EQ(first[0], second[0]);
  EXPECT_EQ(first[1], second[1]);
  EXPECT_EQ(read_block(*first[2]).received_unix_ms, 7.0);
}

TEST(FrameHistory, MarksOnlyTheDegradedBlock) {
  FrameHistory history(60.0, plenty);
  history.add(frames_from(1, 10), false, 0.0);
  history.add(frames_from(11, 10), true, 0.0);
  history.add(frames_from(21, 10), false, 0.0);
  const auto messages = history.messages();
  ASSERT_EQ(messages.size(), 3U);
  EXPECT_EQ(read_block(*messages[0]).flags, 2U);
  EXPECT_EQ(read_block(*messages[1]).flags, 3U);
  EXPECT_EQ(read_block(*messages[2]).flags, 2U);
}

TEST(FrameHistory, IsBoundedForAnyTimes) {
  const std::size_t most = 3 * FrameHistory::chunk_frames * frame_bytes;
  FrameHistory history(60.0, most);
  std::vector<Frame> frames = frames_from(1, 500);
  for (Frame& frame : frames) frame.time_ns = 5;  // a source with a stopped clock
  for (int i = 0; i < 100; ++i) history.add(frames, false, 0.0);
  EXPECT_LE(history.bytes(), most + FrameHistory::chunk_frames * frame_bytes);
  for (Frame& frame : frames) frame.time_ns = std::numeric_limits<std::int64_t>::max();
  history.add(frames, false, 0.0);
  for (Frame& frame : frames) frame.time_ns = std::numeric_limits<std::int64_t>::min();
  for (int i = 0; i < 100; ++i) history.add(frames, i % 2 == 0, 0.0);
  EXPECT_LE(history.bytes(), most + FrameHistory::chunk_frames * frame_bytes);
}

TEST(FrameHistory, OfZeroLengthIsEmpty) {
  FrameHistory history(0.0, plenty);
  history.add(frames_from(1, 5000), false, 0.0);
  EXPECT_TRUE(history.messages().empty());
}

TEST(FrameHistory, IsEmptyAfterClear) {
  FrameHistory history(60.0, plenty);
  history.add(frames_from(1, 1500), false, 0.0);
  history.clear();
  EXPECT_TRUE(history.messages().empty());
  EXPECT_EQ(history.bytes(), 0U);
}

TEST(FrameTimes, AreExactForReceivedFrames) {
  FrameTimes times;
  Frame odd = frame_at(12);
  odd.time_ns += 321;
  times.add(frame_at(11));
  times.add(odd);
  times.add(frame_at(13));
  EXPECT_EQ(times.time_ns(12, 13, 13'000'000), 12'000'321);
}

TEST(FrameTimes, AreExtrapolatedForMissedFrames) {
  FrameTimes times;
  EXPECT_EQ(times.time_ns(3, 4, 4'000'000), std::nullopt);
  times.add(frame_at(10));
  EXPECT_EQ(times.time_ns(3, 4, 4'000'000), std::nullopt) << "one frame has no period";
  times.add(frame_at(14));
  EXPECT_EQ(times.time_ns(12, 14, 14'000'000), 12'000'000);
  EXPECT_EQ(times.time_ns(15, 15, 15'000'100), 15'000'100);
  times.clear();
  EXPECT_EQ(times.time_ns(10, 14, 14'000'000), std::nullopt);
}

TEST(FrameTimes, DoNotConfuseOldFrames) {
  FrameTimes times;
  for (std::uint64_t i = 1; i < 100'000; ++i) times.add(frame_at(i));
  for (std::uint64_t i = 1; i < 100'000; i += 997) {
    EXPECT_EQ(times.time_ns(i, 99'999, 99'999'000'000), static_cast<std::int64_t>(i) * 1'000'000);
  }
}

RC_GTEST_PROP(FrameTimes, DoNotOverflow, ()) {
  FrameTimes times;
  for (int i = 0; i < 5; ++i) {
    Frame frame;
    frame.sequence = *rc::gen::arbitrary<std::uint64_t>();
    frame.time_ns = *rc::gen::arbitrary<std::int64_t>();
    times.add(frame);
  }
  // Overflows are detected by the sanitizers.
  times.time_ns(*rc::gen::arbitrary<std::uint64_t>(), *rc::gen::arbitrary<std::uint64_t>(),
                *rc::gen::arbitrary<std::int64_t>());
}

}  // namespace
}  // namespace stickslip::scope
