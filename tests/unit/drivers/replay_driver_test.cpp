// SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/replay_driver.h"

#include <gtest/gtest.h>

#include <bit>
#include <chrono>
#include <random>
#include <vector>

namespace stickslip::drivers {
namespace {

using Clock = std::chrono::steady_clock;

/// Frames with any finite value, gaps in sequence and time, and missing channels.
std::vector<Frame> recorded(std::size_t count, std::int64_t period_ns) {
  std::mt19937_64 random(3);
  std::vector<Frame> frames(count);
  std::int64_t time_ns = 1'700'000'000'000'000'000;
  std::uint64_t sequence = 1'000'000;
  for (Frame& frame : frames) {
    frame.time_ns = time_ns;
    frame.sequence = sequence;
    for (const Channel channel : {Channel::displacement, Channel::velocity, Channel::normal_load}) {
      const auto value = std::bit_cast<double>(random() & 0xbfff'ffff'ffff'ffffU);
      if (random() % 4 != 0) frame.set(channel, value);
    }
    time_ns += period_ns;
    sequence += random() % 8 == 0 ? 3 : 1;
  }
  return frames;
}

bool same_bits(const Frame& a, const Frame& b) {
  bool same = a.time_ns == b.time_ns && a.sequence == b.sequence && a.valid == b.valid;
  for (std::size_t i = 0; i < channel_count; ++i) {
    same = same &&
           std::bit_cast<std::uint64_t>(a.value[i]) == std::bit_cast<std::uint64_t>(b.value[i]);
  }
  return same;
}

void expect_all(ReplayDriver& driver, const std::vector<Frame>& frames) {
  ASSERT_TRUE(driver.start());
  for (const Frame& expected : frames) {
    Frame frame;
    Result result = driver.read(frame);
    while (result.outcome == Outcome::no_data) result = driver.read(frame);
    ASSERT_TRUE(result);
    ASSERT_TRUE(same_bits(frame, expected));
  }
  Frame untouched;
  untouched.sequence = 7;
  EXPECT_EQ(driver.read(untouched).outcome, Outcome::end_of_data);
  EXPECT_EQ(driver.read(untouched).outcome, Outcome::end_of_data);
  EXPECT_EQ(untouched.sequence, 7U);
}

TEST(ReplayDriver, ReturnsTheFramesBitForBitRepeatedly) {
  const auto frames = recorded(5000, 1'000'000);
  ReplayDriver driver(frames, 0.0);
  ASSERT_TRUE(driver.open());
  expect_all(driver, frames);
  driver.stop();
  expect_all(driver, frames);
}

TEST(ReplayDriver, DescribesTheRecording) {
  const ReplayDriver paced(recorded(100, 1'000'000), 2.0);
  EXPECT_TRUE(paced.description().paced);
  EXPECT_FALSE(paced.description().can_drive);
  EXPECT_EQ(paced.description().channels, 0b001011);
  EXPECT_FALSE(ReplayDriver(recorded(1, 1), 0.0).description().paced);
}

TEST(ReplayDriver, NoFrameIsEarly) {
  const std::int64_t period_ns = 10'000'000;
  const auto frames = recorded(21, period_ns);
  for (const double speed : {1.0, 4.0}) {
    ReplayDriver driver(frames, speed);
    ASSERT_TRUE(driver.open());
    const auto before = Clock::now();
    ASSERT_TRUE(driver.start());
    for (std::size_t i = 0; i < frames.size(); ++i) {
      Frame frame;
      ASSERT_TRUE(driver.read(frame));
      const std::chrono::duration<double, std::nano> since = Clock::now() - before;
      ASSERT_GE(since.count(), static_cast<double>(i) * static_cast<double>(period_ns) / speed);
    }
  }
}

TEST(ReplayDriver, UnpacedReplayDoesNotWait) {
  // Two hours of recording: any wait would be noticed.
  const auto frames = recorded(7200, 1'000'000'000);
  ReplayDriver driver(frames, 0.0);
  ASSERT_TRUE(driver.open());
  expect_all(driver, frames);
}

TEST(ReplayDriver, GapDoesNotBlockTheLoop) {
  auto frames = recorded(2, 3'600'000'000'000);  // an hour apart
  for (const double speed : {1.0, 1.0e-300}) {
    ReplayDriver driver(frames, speed);
    ASSERT_TRUE(driver.open());
    ASSERT_TRUE(driver.start());
    Frame frame;
    ASSERT_TRUE(driver.read(frame));
    for (int i = 0; i < 2; ++i) EXPECT_EQ(driver.read(frame).outcome, Outcome::no_data);
    EXPECT_TRUE(same_bits(frame, frames[0]));
  }
}

TEST(ReplayDriver, EmptyRecordingIsRejected) {
  ReplayDriver driver({}, 1.0);
  const Result result = driver.open();
  EXPECT_EQ(result.outcome, Outcome::needs_attention);
  EXPECT_STRNE(result.message, "");
}

TEST(ReplayDriver, TheLifecycleMayBeCalledInAnyOrder) {
  const auto frames = recorded(1000, 1'000'000);
  for (unsigned seed = 0; seed < 200; ++seed) {
    std::mt19937 random(seed);
    ReplayDriver driver(frames, 0.0);
    bool open = false;
    bool running = false;
    for (int i = 0; i < 30; ++i) {
      Frame frame;
      switch (random() % 6) {
        case 0:
          EXPECT_TRUE(driver.open());
          open = true;
          break;
        case 1:
          EXPECT_EQ(static_cast<bool>(driver.start()), open);
          running = open;
          break;
        case 2:
          EXPECT_EQ(static_cast<bool>(driver.read(frame)), running);
          break;
        case 3:
          EXPECT_TRUE(driver.write({}));
          break;
        case 4:
          driver.stop();
          running = false;
          break;
        default:
          driver.close();
          open = running = false;
      }
    }
  }
}

}  // namespace
}  // namespace stickslip::drivers
