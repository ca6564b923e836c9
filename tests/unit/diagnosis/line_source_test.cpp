// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/line_source.h"

#include <gtest/gtest.h>

namespace stickslip::diagnosis {
namespace {

const LineContext bench = {.drive_hz = 3.7, .sampling_hz = 500.0, .other_hz = {24.3}};

TEST(LineSource, NamesTheMainsWithinTheirDeviation) {
  EXPECT_EQ(source_of_line(50.1, 0.01, bench), "It has the frequency of the mains (50 Hz).");
  EXPECT_EQ(source_of_line(119.8, 0.01, bench), "It is the second harmonic of the mains (60 Hz).");
}

TEST(LineSource, NamesMainsThatSamplingHasMoved) {
  EXPECT_EQ(source_of_line(10.2, 0.01, {.drive_hz = 3.7, .sampling_hz = 60.2}),
            "It is the alias of the mains' 50 Hz, sampled at 60.2 Hz.");
}

TEST(LineSource, NamesHarmonicsOfTheDriveAndOfOtherTones) {
  EXPECT_EQ(source_of_line(11.1, 0.02, bench), "It is the third harmonic of the drive (3.7 Hz).");
  EXPECT_EQ(source_of_line(48.6, 0.02, bench), "It is the second harmonic of the tone at 24.3 Hz.");
}

TEST(LineSource, GivesAnyOtherToneAsTheSpeedOfAShaft) {
  EXPECT_EQ(source_of_line(24.5, 0.02, bench),
            "It is a multiple of neither the mains nor the drive: a shaft at 1470 rpm would "
            "cause it.");
}

TEST(LineSource, ClaimsNothingOfATooUncertainFrequency) {
  // 11.1 Hz within 0.5 Hz: a multiple of 3.7 Hz would be there by chance.
  EXPECT_NE(source_of_line(11.1, 0.5, bench), source_of_line(11.1, 0.02, bench));
}

}  // namespace
}  // namespace stickslip::diagnosis
