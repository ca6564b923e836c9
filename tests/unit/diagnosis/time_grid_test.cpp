// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/time_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace stickslip::diagnosis {
namespace {

constexpr std::uint8_t displacement_bit = 1U << index_of(Channel::displacement);

// Rows at the given times, rounded to a number of nanoseconds.
std::vector<Frame> rows_at(const std::vector<double>& times_s, std::int64_t rounding_ns = 1) {
  std::vector<Frame> frames;
  for (const double time_s : times_s) {
    Frame frame;
    frame.time_ns = rounding_ns * std::llround(time_s * 1.0e9 / static_cast<double>(rounding_ns));
    frame.set(Channel::displacement, 1.0);
    frames.push_back(frame);
  }
  return frames;
}

std::vector<double> regular(double period_s, int count, double start_s = 0.0) {
  std::vector<double> out;
  for (int k = 0; k < count; ++k) out.push_back(start_s + period_s * k);
  return out;
}

std::vector<double> jittered(double period_s, int count, double periods, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> jitter(-periods * period_s, periods * period_s);
  std::vector<double> out = regular(period_s, count, 1.0);
  for (double& each : out) each += jitter(random);
  return out;
}

TEST(TimeGrid, IsExactForExactTimes) {
  const TimeGrid grid = time_grid_of(rows_at(regular(0.005, 4001)));
  EXPECT_EQ(grid.period_s, 0.005);
  EXPECT_EQ(grid.start_s, 0.0);
  EXPECT_EQ(grid.instants(), 4001U);
  ASSERT_EQ(grid.segments.size(), 1U);
  EXPECT_TRUE(grid.after_s.empty());
}

// A camera at 29.96 frames per second whose file has three decimals: the median step is 33 ms.
TEST(TimeGrid, IsNotBiasedByTheRoundingOfTheFile) {
  const double period_s = 0.0333778;
  const TimeGrid grid = time_grid_of(rows_at(regular(period_s, 600, 0.033), 1'000'000));
  EXPECT_NEAR(grid.period_s, period_s, 1.0e-6);
  EXPECT_EQ(grid.instants(), 600U);
  EXPECT_TRUE(grid.after_s.empty());  // the line knows the times better than the file
  // Rounded to almost the period itself: steps of 1 and 2 ms.
  const TimeGrid coarse = time_grid_of(rows_at(regular(1.0 / 700.0, 7000), 1'000'000));
  EXPECT_NEAR(coarse.period_s, 1.0 / 700.0, 1.0e-8);
  EXPECT_EQ(coarse.instants(), 7000U);
}

TEST(TimeGrid, InfersMissingRows) {
  std::vector<double> times = regular(0.0333778, 2000);
  std::mt19937_64 random(5);
  std::erase_if(times, [&](double time_s) { return time_s > 0.0 && random() % 10 == 0; });
  const auto frames = rows_at(times, 1'000'000);
  const TimeGrid grid = time_grid_of(frames);
  EXPECT_NEAR(grid.period_s, 0.0333778, 1.0e-6);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ(grid.instant[i], std::lround(times[i] / 0.0333778)) << i;
  }
}

TEST(TimeGrid, KeepsTrueTimesOfJitteredRows) {
  const double period_s = 0.002;
  const std::vector<double> times = jittered(period_s, 5000, 0.35, 3);
  const TimeGrid grid = time_grid_of(rows_at(times));
  EXPECT_NEAR(grid.period_s, period_s, 1.0e-7);
  EXPECT_EQ(grid.instants(), 5000U);
  ASSERT_EQ(grid.after_s.size(), 5000U);
  EXPECT_NEAR(grid.jitter_s, 0.35 * period_s, 0.02 * period_s);
  for (std::size_t i = 0; i < times.size(); ++i) {
    const double at = grid.start_s + grid.period_s * grid.instant[i] + grid.after_s[i];
    ASSERT_NEAR(at, times[i], 1.0e-8) << i;
  }
}

// Rows that come late together, by more than half a period, lose no instant.
TEST(TimeGrid, PutsLateRowsInTheirOwnInstants) {
  std::vector<double> times = regular(0.001, 3000);
  for (std::size_t i = 1000; i < 1004; ++i) times[i] += 0.0007;
  const TimeGrid grid = time_grid_of(rows_at(times));
  for (std::size_t i = 0; i < times.size(); ++i) EXPECT_EQ(grid.instant[i], i);
}

TEST(TimeGrid, AGapOfAnyLengthTakesOneInstant) {
  std::vector<double> times = regular(0.001, 2000);
  const double gap_s = 5.0e6 + 0.0003;  // not even a whole number of periods
  for (const double time_s : regular(0.001, 3000, 2.0 + gap_s)) times.push_back(time_s);
  const TimeGrid grid = time_grid_of(rows_at(times));
  EXPECT_NEAR(grid.period_s, 0.001, 1.0e-12);
  EXPECT_EQ(grid.instants(), 5001U);
  ASSERT_EQ(grid.segments.size(), 2U);
  EXPECT_EQ(grid.segments[1].begin, 2001U);
  EXPECT_NEAR(grid.segments[1].start_s, 2.0 + gap_s, 1.0e-6);
  EXPECT_TRUE(grid.after_s.empty());
}

// Rows of two devices at one instant: a grid of their common rate.
TEST(TimeGrid, RowsOfDifferentChannelsShareAnInstant) {
  std::vector<Frame> frames;
  for (int k = 0; k < 1000; ++k) {
    frames.push_back(rows_at({0.001 * k}).front());
    if (k % 8 != 0) continue;
    Frame slow;
    slow.time_ns = 1'000'000 * k + 200'000;
    slow.set(Channel::normal_load, 2.0);
    frames.push_back(slow);
  }
  const TimeGrid grid = time_grid_of(frames);
  EXPECT_NEAR(grid.period_s, 0.001, 1.0e-7);
  EXPECT_EQ(grid.instants(), 1000U);
  EXPECT_EQ(frames[1].valid & displacement_bit, 0);
  EXPECT_EQ(grid.instant[0], grid.instant[1]);
}

}  // namespace
}  // namespace stickslip::diagnosis
