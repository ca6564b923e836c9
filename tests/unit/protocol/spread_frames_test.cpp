// SPDX-License-Identifier: Apache-2.0
#include "protocol/spread_frames.h"

#include <gtest/gtest.h>

#include <string>

namespace stickslip::protocol {
namespace {

Recording spread(std::int64_t count, std::size_t most) {
  SpreadFrames frames(most);
  for (std::int64_t k = 0; k < count; ++k) {
    Frame frame;
    frame.time_ns = k;
    frame.sequence = static_cast<std::uint64_t>(k);
    frames.add(frame);
  }
  Recording recording;
  frames.finish(recording);
  return recording;
}

TEST(SpreadFrames, KeepsAllUpToTheLimit) {
  const Recording recording = spread(1600, 1600);
  EXPECT_EQ(recording.frames.size(), 1600U);
  EXPECT_EQ(recording.left_out, 0U);
  EXPECT_TRUE(recording.after_left_out.empty());
}

// Whatever the length: most of the limit, in whole blocks, from the beginning to the end.
TEST(SpreadFrames, KeepsBlocksSpreadOverALongRecording) {
  for (const std::int64_t count : {1601, 2000, 5000, 100'000, 1'000'003}) {
    const Recording recording = spread(count, 1600);
    const auto& frames = recording.frames;
    EXPECT_LE(frames.size(), 1600U);
    EXPECT_GE(frames.size(), 1200U) << count;
    EXPECT_EQ(recording.left_out, static_cast<std::uint64_t>(count) - frames.size());
    EXPECT_LT(frames.front().time_ns, count / 4);
    EXPECT_GT(frames.back().time_ns, 3 * count / 4);
    std::size_t jumps = 0;
    for (std::size_t i = 1; i < frames.size(); ++i) {
      const std::int64_t step = frames[i].time_ns - frames[i - 1].time_ns;
      ASSERT_GT(step, 0);
      EXPECT_LT(step, count / 4);
      if (step == 1) continue;
      ASSERT_LT(jumps, recording.after_left_out.size());
      EXPECT_EQ(recording.after_left_out[jumps++], i);
    }
    EXPECT_EQ(jumps, recording.after_left_out.size());
  }
}

TEST(SpreadFrames, OfACsvFileKeepTheirRowNumbers) {
  std::string text = "time_s,displacement_m\n";
  for (int k = 0; k < 1000; ++k) text += std::to_string(k) + ",0.5\n";
  const Recording recording = parse_csv(text, "long.csv", {}, 160);
  EXPECT_LE(recording.frames.size(), 160U);
  EXPECT_EQ(recording.frames.size() + recording.left_out, 1000U);
  for (const Frame& frame : recording.frames) {
    EXPECT_EQ(frame.time_ns, static_cast<std::int64_t>(frame.sequence) * 1'000'000'000);
  }
}

}  // namespace
}  // namespace stickslip::protocol
