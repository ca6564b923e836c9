// SPDX-License-Identifier: Apache-2.0
#include "protocol/foreign_csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "physics/problem.h"

namespace stickslip::protocol {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string refusal(const std::string& text, const std::vector<ColumnRule>& rules = {}) {
  try {
    import_csv(text, "in.csv", rules);
  } catch (const InputError& error) {
    return error.what();
  }
  return "none";
}

TEST(ForeignCsv, SemicolonsDecimalCommasAndUnitsInTheHeader) {
  const auto found = import_csv(
      "# logger 3\r\n\"Zeit (ms)\";\"x [mm]\";Normal force / N;Remark\r\n"
      "0,5;-1,25;0,3;ok\r\n1,5;NaN;3e-1;\r\n",
      "in.csv", {});
  ASSERT_EQ(found.recording.frames.size(), 2u);
  EXPECT_EQ(found.recording.frames[0].time_ns, 500'000);
  EXPECT_EQ(found.recording.frames[1].time_ns, 1'500'000);
  EXPECT_DOUBLE_EQ(found.recording.frames[0][Channel::displacement], -1.25e-3);
  EXPECT_DOUBLE_EQ(found.recording.frames[1][Channel::normal_load], 0.3);
  EXPECT_FALSE(found.recording.frames[1].has(Channel::displacement));
  EXPECT_THAT(found.guesses,
              ElementsAre("columns are separated by semicolons, the decimal sign is a comma",
                          "time_s is column \"Zeit (ms)\" times 0.001",
                          "displacement_m is column \"x [mm]\" times 0.001",
                          "normal_load_n is column \"Normal force / N\"", "ignored: \"Remark\""));
}

TEST(ForeignCsv, TabsAndColumnsNamedAsInAContractFileWithAnotherUnit) {
  const auto found =
      import_csv("time_s\tvelocity_mm_s\tdisplacement_m\n0\t5\t1\n0.1\t6\t2\n", "in.csv", {});
  EXPECT_DOUBLE_EQ(found.recording.frames[1][Channel::velocity], 6.0e-3);
  EXPECT_DOUBLE_EQ(found.recording.frames[1][Channel::displacement], 2.0);
}

TEST(ForeignCsv, CommasWithinQuotedNumbers) {
  const auto found = import_csv("t [s],x [m]\n\"0,1\",\"1,5\"\n\"0,2\",\"2,5\"\n", "in.csv", {});
  EXPECT_DOUBLE_EQ(found.recording.frames[1][Channel::displacement], 2.5);
}

TEST(ForeignCsv, RulesDecideWhatTheHeaderLeavesOpen) {
  const std::vector<ColumnRule> rules = {{"Kanal 1", "displacement", "um", -2.0},
                                         {"time", {}, "ms"},
                                         {"Force", "drive_force"},
                                         {"v [m/s]", "ignore"}};
  const auto found =
      import_csv("time;Kanal 1;Force/kN;v [m/s]\n1;3;4;5\n2;6;8;10\n", "in.csv", rules);
  const Frame& frame = found.recording.frames[0];
  EXPECT_EQ(frame.time_ns, 1'000'000);
  EXPECT_DOUBLE_EQ(frame[Channel::displacement], -6.0e-6);
  EXPECT_DOUBLE_EQ(frame[Channel::drive_force], 4000.0);
  EXPECT_FALSE(frame.has(Channel::velocity));
}

TEST(ForeignCsv, RefusesWhatItCannotDecide) {
  EXPECT_THAT(refusal("t;x [m]\n1;2\n"),
              AllOf(HasSubstr("in.csv:1: column \"t\" (time_s) has no unit"), HasSubstr("--unit")));
  EXPECT_THAT(refusal("t [s];x [N]\n1;2\n"),
              AllOf(HasSubstr("unit \"N\""), HasSubstr("m, cm, mm")));
  EXPECT_THAT(refusal("t [s];Force/N\n1;2\n"), HasSubstr("friction force or the drive force"));
  EXPECT_THAT(refusal("x [m];v [m/s]\n1;2\n"), HasSubstr("no column of time"));
  EXPECT_THAT(refusal("t [s];a;b1\n1;2;3\n"), HasSubstr("no column that is a channel"));
  EXPECT_THAT(refusal("t [s];x [m];position [mm]\n1;2;3\n"), HasSubstr("expected one"));
  EXPECT_THAT(refusal("t [s];x [m]\n1;1.234,5\n"), HasSubstr("one decimal sign"));
  EXPECT_THAT(refusal("t [s];x [m]\n1;2\n2;three\n"), HasSubstr("in.csv:3: column \"x [m]\""));
  EXPECT_THAT(refusal("t [s];x [m]\n1;2\n1;3\n"), HasSubstr("in.csv:3: time does not increase"));
  EXPECT_THAT(refusal("t [s];x [m]\n1;2;3\n"), HasSubstr("in.csv:2: has 3 cells"));
  EXPECT_THAT(refusal("t [s];x [m]\n1;2\n", {{"y", "velocity"}}), HasSubstr("has no column \"y\""));
  EXPECT_THAT(refusal("t x v\n1 2 3\n"), HasSubstr("semicolons, tabs or commas"));
}

}  // namespace
}  // namespace stickslip::protocol
