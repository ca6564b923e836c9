// SPDX-License-Identifier: Apache-2.0
#include "daemon/frame_sequencer.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cstdint>

namespace stickslip::daemon {
namespace {

constexpr std::int64_t ms = 1'000'000;

Frame frame_at(std::uint64_t sequence, std::int64_t time_ns) {
  Frame frame;
  frame.sequence = sequence;
  frame.time_ns = time_ns;
  return frame;
}

TEST(FrameSequencer, LeavesARegularSourceUnchanged) {
  FrameSequencer sequencer(ms);
  for (std::uint64_t i = 5; i < 100; ++i) {
    Frame frame = frame_at(i, static_cast<std::int64_t>(i) * ms);
    const FramePlacement placement = sequencer.place(frame, 0);
    EXPECT_TRUE(placement.accepted);
    EXPECT_EQ(placement.missing, 0U);
    EXPECT_EQ(placement.step_ns, ms);
    EXPECT_EQ(frame.sequence, i);
    EXPECT_EQ(frame.time_ns, static_cast<std::int64_t>(i) * ms);
  }
}

TEST(FrameSequencer, CountsMissingFramesAndTakesALongGapAsOnePeriod) {
  FrameSequencer sequencer(ms);
  Frame frame = frame_at(0, 0);
  sequencer.place(frame, 0);
  frame = frame_at(4, 4 * ms);
  FramePlacement placement = sequencer.place(frame, 0);
  EXPECT_EQ(placement.missing, 3U);
  EXPECT_EQ(placement.step_ns, 4 * ms);
  frame = frame_at(5, 3'600'000 * ms);
  placement = sequencer.place(frame, 0);
  EXPECT_EQ(placement.missing, 0U);
  EXPECT_EQ(placement.step_ns, ms);
}

TEST(FrameSequencer, RejectsRepeatedFramesAndMarksTheFirstOfARow) {
  FrameSequencer sequencer(ms);
  Frame frame = frame_at(7, 7 * ms);
  sequencer.place(frame, 0);
  for (const bool first : {true, false}) {
    frame = frame_at(7, 8 * ms);
    const FramePlacement placement = sequencer.place(frame, 0);
    EXPECT_FALSE(placement.accepted);
    EXPECT_EQ(placement.first_repeat, first);
  }
  frame = frame_at(8, 8 * ms);
  EXPECT_TRUE(sequencer.place(frame, 0).accepted);
}

TEST(FrameSequencer, ShiftsASourceWhoseTimeWentBack) {
  FrameSequencer sequencer(ms);
  Frame frame = frame_at(0, 1000 * ms);
  sequencer.place(frame, 0);
  frame = frame_at(2, 0);
  const FramePlacement placement = sequencer.place(frame, 0);
  EXPECT_EQ(placement.jump_ns, -1002 * ms);
  EXPECT_EQ(frame.time_ns, 1002 * ms);
  frame = frame_at(3, 1 * ms);
  EXPECT_EQ(sequencer.place(frame, 0).jump_ns, 0);
  EXPECT_EQ(frame.time_ns, 1003 * ms);
}

TEST(FrameSequencer, ReportsASourceWhoseTimeJumpedAhead) {
  FrameSequencer sequencer(ms);
  Frame frame = frame_at(0, 0);
  sequencer.place(frame, 0);
  frame = frame_at(1, 5001 * ms);
  EXPECT_EQ(sequencer.place(frame, ms).jump_ns, 5000 * ms);
  EXPECT_EQ(frame.time_ns, 5001 * ms);
  // Time that has passed on the host, and lost frames, are no jump.
  frame = frame_at(2, 7001 * ms);
  EXPECT_EQ(sequencer.place(frame, 2001 * ms).jump_ns, 0);
  frame = frame_at(1002, 8001 * ms);
  EXPECT_EQ(sequencer.place(frame, 2002 * ms).jump_ns, 0);
  frame = frame_at(1003, 8090 * ms);  // jitter
  EXPECT_EQ(sequencer.place(frame, 2003 * ms).jump_ns, 0);
}

TEST(FrameSequencer, ARestartedDeviceContinuesTheNumbersWithTheSkippedCycles) {
  FrameSequencer sequencer(ms);
  Frame frame = frame_at(41, 41 * ms);
  sequencer.place(frame, 0);
  for (int i = 0; i < 10; ++i) sequencer.skip_cycle();
  sequencer.restart_numbering();
  frame = frame_at(0, 52 * ms);
  const FramePlacement placement = sequencer.place(frame, 0);
  EXPECT_EQ(frame.sequence, 52U);
  EXPECT_EQ(placement.missing, 10U);
}

RC_GTEST_PROP(FrameSequencer, TimesAndNumbersAlwaysIncrease, ()) {
  FrameSequencer sequencer(ms);
  std::int64_t host_ns = 1'000'000 * ms;
  std::int64_t number = 0;  // of the device, from 0 after each restart
  bool any = false;
  Frame latest;
  for (int i = 0; i < 200; ++i) {
    host_ns += *rc::gen::inRange<std::int64_t>(1, 5 * ms);
    number = std::max<std::int64_t>(0, number + *rc::gen::inRange(-1, 4));
    if (*rc::gen::inRange(0, 40) == 0) sequencer.skip_cycle();
    if (*rc::gen::inRange(0, 60) == 0) {
      sequencer.restart_numbering();
      number = 0;
    }
    Frame frame = frame_at(static_cast<std::uint64_t>(number),
                           *rc::gen::inRange<std::int64_t>(0, 100'000 * ms));
    if (!sequencer.place(frame, host_ns).accepted) continue;
    RC_ASSERT(!any || frame.sequence > latest.sequence);
    RC_ASSERT(!any || frame.time_ns > latest.time_ns);
    latest = frame;
    any = true;
  }
}

}  // namespace
}  // namespace stickslip::daemon
