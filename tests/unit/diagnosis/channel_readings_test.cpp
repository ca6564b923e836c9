// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/channel_readings.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace stickslip::diagnosis {
namespace {

constexpr double period_s = 0.002;

double motion(double time_s) { return std::sin(2.0 * std::numbers::pi * 3.0 * time_s); }

// One channel in every `stride`-th row, with noise, jitter and a constant age.
std::vector<Frame> rows(int count, int stride, double noise_std, double jitter_periods = 0.0,
                        std::int32_t age_us = 0) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> noise(0.0, noise_std);
  std::uniform_real_distribution<double> jitter(-jitter_periods, jitter_periods);
  std::vector<Frame> frames;
  for (int k = 0; k < count; ++k) {
    Frame frame;
    frame.time_ns = std::llround(1.0e9 * period_s * (k + jitter(random)));
    frame.set(Channel::base_displacement, 0.0);
    if (k % stride == 0) {
      frame.set(Channel::displacement, motion(frame.time_s() - 1.0e-6 * age_us) + noise(random));
      frame.age_us[index_of(Channel::displacement)] = age_us;
    }
    frames.push_back(frame);
  }
  return frames;
}

ChannelReadings displacement_of(const std::vector<Frame>& frames) {
  return readings_of(frames, time_grid_of(frames), Channel::displacement);
}

double worst_error(const std::vector<Frame>& frames) {
  const TimeGrid grid = time_grid_of(frames);
  const auto readings = readings_of(frames, grid, Channel::displacement);
  const Range range = covered(readings, grid, 0).at(0);
  const Series series = series_over(readings, grid, range);
  double worst = 0.0;
  for (std::size_t i = 3; i + 3 < series.value.size(); ++i) {
    const double at = series.first + series.spacing * static_cast<double>(i);
    const double time_s = grid.start_s + grid.period_s * at;
    worst = std::max(worst, std::abs(series.value[i] - motion(time_s)));
  }
  return worst;
}

// Values filled in between readings have no noise of their own.
TEST(ChannelReadings, NoiseOfASlowChannelIsThatOfItsReadings) {
  const auto frames = rows(16000, 8, 1.0e-2);
  const ChannelReadings readings = displacement_of(frames);
  EXPECT_EQ(readings.spacing, 8.0);
  EXPECT_EQ(readings.list.size(), 2000U);
  EXPECT_NEAR(noise_of(readings), 1.0e-2, 1.0e-3);
}

TEST(ChannelReadings, NoiseSkipsMissingRowsAndAllowsForJitter) {
  auto frames = rows(8000, 1, 1.0e-3, 0.3);
  for (std::size_t i = 5; i < frames.size(); i += 11) frames[i].invalidate(Channel::displacement);
  EXPECT_NEAR(noise_of(displacement_of(frames)), 1.0e-3, 1.0e-4);
}

TEST(ChannelReadings, AreTakenAtTheirOwnTimes) {
  EXPECT_LT(worst_error(rows(4000, 1, 0.0, 0.3)), 1.0e-6);
  EXPECT_LT(worst_error(rows(4000, 1, 0.0, 0.0, 700)), 1.0e-6);
  EXPECT_LT(worst_error(rows(4000, 8, 0.0, 0.2, 1500)), 1.0e-3);
}

TEST(ChannelReadings, ARepeatedReadingIsOne) {
  auto frames = rows(400, 1, 0.0);
  for (std::size_t i = 1; i < frames.size(); i += 2) {  // the device repeats the reading before
    frames[i].set(Channel::displacement, frames[i - 1][Channel::displacement]);
    frames[i].age_us[index_of(Channel::displacement)] = 2000;
  }
  const ChannelReadings readings = displacement_of(frames);
  EXPECT_EQ(readings.list.size(), 200U);
  EXPECT_EQ(readings.spacing, 2.0);
}

// Few samples may be missing from a smooth channel, none from one that jumps.
TEST(ChannelReadings, KnowWhatInterpolationRestores) {
  EXPECT_GE(most_restorable(displacement_of(rows(4000, 1, 1.0e-3)), 1.0e-3), 4U);
  auto square = rows(4000, 1, 0.0);
  for (std::size_t k = 0; k < square.size(); ++k) {
    square[k].set(Channel::displacement, k / 5 % 2 == 0 ? 1.0 : -1.0);
  }
  EXPECT_EQ(most_restorable(displacement_of(square), 1.0e-3), 0U);
}

TEST(ChannelReadings, AreCutWhereTooManyAreMissing) {
  auto frames = rows(1000, 1, 0.0);
  for (std::size_t i = 300; i < 303; ++i) frames[i].invalidate(Channel::displacement);
  for (std::size_t i = 600; i < 610; ++i) frames[i].invalidate(Channel::displacement);
  const TimeGrid grid = time_grid_of(frames);
  const auto ranges = covered(readings_of(frames, grid, Channel::displacement), grid, 4);
  ASSERT_EQ(ranges.size(), 2U);
  EXPECT_EQ(ranges[0].end, 600U);
  EXPECT_EQ(ranges[1].begin, 610U);
  const Range half{500, 1000};
  const auto both = common(ranges, std::span(&half, 1));
  ASSERT_EQ(both.size(), 2U);
  EXPECT_EQ(both[0].begin, 500U);
  EXPECT_EQ(both[1].begin, 610U);
}

}  // namespace
}  // namespace stickslip::diagnosis
