// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/outliers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "bench.h"
#include "diagnosis/diagnosis.h"
#include "diagnosis/integrity.h"

namespace stickslip::diagnosis {
namespace {

using test::driven_mass;
using test::record;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<std::size_t> frames_of(const std::vector<Outlier>& outliers) {
  std::vector<std::size_t> frames;
  for (const Outlier& each : outliers) frames.push_back(each.frame);
  return frames;
}

void set(protocol::Recording& recording, std::size_t frame, Channel channel, double value) {
  recording.frames[frame].set(channel, value);
}

TEST(Outliers, CleanRecordingHasNone) {
  EXPECT_THAT(outliers_of(record(driven_mass(), 30.0)), IsEmpty());
  EXPECT_THAT(outliers_of(record(driven_mass(), 30.0, 1, false)), IsEmpty());
}

TEST(Outliers, FindsSingleSamplesWhateverTheirSize) {
  auto recording = record(driven_mass(), 30.0);
  const double before = recording.frames[3000][Channel::displacement];
  set(recording, 500, Channel::displacement, 100.0);
  set(recording, 3000, Channel::displacement, before + 0.005);  // 250 times the noise, in range
  set(recording, 4000, Channel::drive_force, -500.0);
  const auto found = outliers_of(recording);
  EXPECT_THAT(frames_of(found), ElementsAre(500, 3000, 4000));
  EXPECT_EQ(found[0].value, 100.0);
  EXPECT_EQ(found[0].time_s, 2.5);
  EXPECT_NEAR(found[1].expected, before, 2.0e-3);
}

TEST(Outliers, FindsRunsNeighboursAndTheFirstAndLastSample) {
  auto recording = record(driven_mass(), 30.0);
  for (const std::size_t k : {0UL, 1000UL, 1001UL, 1002UL, 1004UL, 6000UL}) {
    set(recording, k, Channel::displacement, -3.0 - static_cast<double>(k % 5));
  }
  EXPECT_THAT(frames_of(outliers_of(recording)), ElementsAre(0, 1000, 1001, 1002, 1004, 6000));
}

TEST(Outliers, EdgesRailsAndCoarseStepsAreNone) {
  auto recording = record(driven_mass(), 30.0);
  for (std::size_t k = 0; k < recording.frames.size(); ++k) {
    const double x = recording.frames[k][Channel::displacement];
    set(recording, k, Channel::displacement, 2.0e-3 * std::round(std::min(x, 0.02) / 2.0e-3));
    set(recording, k, Channel::drive_force, k % 400 < 200 ? 1.5 : -1.5);
  }
  EXPECT_THAT(outliers_of(recording), IsEmpty());
}

TEST(Outliers, ABlowOfAHammerIsAnEvent) {
  auto recording = record(driven_mass(), 30.0, 1, true, [](double t) {
    return t >= 10.0 && t < 10.0 + 0.5 / test::rate_hz ? 200.0 : 0.0;
  });
  for (Frame& frame : recording.frames) {
    frame.set(Channel::drive_force, frame.time_ns == 10'000'000'000 ? 200.0 : 0.0);
  }
  EXPECT_THAT(outliers_of(recording), IsEmpty());
}

TEST(Outliers, AreNotMeasuredAndLeaveTheRestAsItWas) {
  auto recording = record(driven_mass(), 30.0);
  const Cleaned untouched(recording);
  EXPECT_EQ(&untouched.recording(), &recording);
  const protocol::Recording good = recording;
  set(recording, 500, Channel::displacement, 100.0);
  const Cleaned cleaned(recording);
  EXPECT_FALSE(cleaned.recording().frames[500].has(Channel::displacement));
  EXPECT_TRUE(cleaned.recording().frames[500].has(Channel::drive_force));
  const Experiment e = make_experiment(recording, driven_mass());
  EXPECT_FALSE(e.is_compared(500, index_of(Channel::displacement)));
  const double usual = make_experiment(good, driven_mass()).largest.displacement_m;
  EXPECT_NEAR(e.largest.displacement_m, usual, 1.0e-3 * usual);
}

TEST(Outliers, AreReportedWithChannelAndTime) {
  auto recording = record(driven_mass(), 30.0);
  set(recording, 500, Channel::displacement, 100.0);
  const Integrity found = integrity_of(recording, driven_mass());
  EXPECT_LT(found.channels[0].highest, 1.0);
  EXPECT_EQ(found.channels[0].missing, 0u);
  ASSERT_EQ(found.remarks.size(), 1u);
  EXPECT_THAT(found.remarks[0],
              HasSubstr("displacement has 1 bad sample, which is not used: 100 m at 2.500 s"));
}

TEST(Outliers, AFewAreNoFinding) {
  auto recording = record(driven_mass(), 30.0);
  set(recording, 500, Channel::displacement, 100.0);
  set(recording, 2500, Channel::displacement, 3.0);
  set(recording, 4000, Channel::drive_force, -500.0);
  EXPECT_EQ(diagnose({recording}, driven_mass()).verdict, Verdict::consistent);
}

}  // namespace
}  // namespace stickslip::diagnosis
