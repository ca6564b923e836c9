// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/design/families.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace stickslip::design {
namespace {

RunRange range() {
  RunRange out;
  out.limits = {0.015, 0.5, 20.0};
  return out;
}

// Any point of the cube is a run that the shaker can make.
TEST(Families, StayWithinTheLimitsOfTheDriveAndBeginAndEndAtRest) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform;
  for (const Family family : all_families) {
    for (int i = 0; i < 40; ++i) {
      const RunPlan run{family,
                        uniform(random),
                        uniform(random),
                        {uniform(random), uniform(random), uniform(random)}};
      const Drive drive = drive_of(run, range());
      const DrivePeaks peaks = peaks_of(drive);
      EXPECT_LE(peaks.value, 0.015) << name_of(family);
      EXPECT_LE(peaks.first, 0.5) << name_of(family);
      EXPECT_LE(peaks.second, 20.0) << name_of(family);
      EXPECT_GT(peaks.value, 1.0e-5) << name_of(family);
      EXPECT_EQ(drive.samples.front(), 0.0);
      EXPECT_EQ(drive.samples.back(), 0.0);
      EXPECT_GE(drive.duration_s(), 7.9);
      EXPECT_LE(drive.duration_s(), 20.1);
    }
  }
}

TEST(Families, AmplitudeIsAShareOfWhatTheLimitsAllow) {
  const RunPlan large{Family::modulated, 1.0, 0.5, {0.5, 0.5, 0.5}};
  const RunPlan small{Family::modulated, 0.0, 0.5, {0.5, 0.5, 0.5}};
  EXPECT_NEAR(peaks_of(drive_of(small, range())).value,
              0.02 * peaks_of(drive_of(large, range())).value, 1.0e-9);
}

TEST(Families, AreDescribedWithFrequencyAmplitudeAndDuration) {
  const std::string words = words_for(usual_runs().front(), range(), false);
  EXPECT_NE(words.find(" Hz"), std::string::npos) << words;
  EXPECT_NE(words.find(" mm, 14 s"), std::string::npos) << words;
  EXPECT_NE(words_for(usual_runs().front(), range(), true).find(" N, "), std::string::npos);
}

TEST(Families, HoldRestsBetweenItsBursts) {
  const Drive drive = drive_of({Family::hold, 1.0, 1.0, {0.5, 0.5, 1.0}}, range());
  std::size_t longest = 0;
  std::size_t now = 0;
  for (const double value : drive.samples) {
    now = value == 0.0 ? now + 1 : 0;
    longest = std::max(longest, now);
  }
  EXPECT_GT(static_cast<double>(longest) * drive.period_s, 10.0);
}

}  // namespace
}  // namespace stickslip::design
