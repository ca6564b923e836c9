// SPDX-License-Identifier: Apache-2.0
// Reading and writing of CSV recordings; malformed_test.cpp has the errors.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>

#include "physics/problem.h"
#include "protocol/recording.h"
#include "tests/unit/protocol/files.h"

namespace stickslip::protocol {
namespace {

std::string csv_of(const Recording& recording) {
  std::ostringstream out;
  write_csv(recording, out);
  return out.str();
}

std::int64_t time_of(const std::string& cell) {
  return parse_csv("time_s,velocity_m_s\n" + cell + ",0\n", "t").frames.at(0).time_ns;
}

TEST(Csv, ReadsColumnsInAnyOrderWithCommentsBlankLinesAndCarriageReturns) {
  const Recording recording = parse_csv(
      "\xEF\xBB\xBF# a rig\r\n\r\nvelocity_m_s, time_s ,displacement_m\r\n"
      "# between\r\n-2.5,0.001,1e-3\r\n, 0.002 , +4\r\n",
      "made up");
  EXPECT_EQ(recording.source, "made up");
  ASSERT_EQ(recording.frames.size(), 2U);
  const Frame& first = recording.frames[0];
  EXPECT_EQ(first.time_ns, 1'000'000);
  EXPECT_EQ(first.sequence, 0U);
  EXPECT_EQ(first[Channel::velocity], -2.5);
  EXPECT_EQ(first[Channel::displacement], 1e-3);
  EXPECT_FALSE(first.has(Channel::friction_force));
  const Frame& second = recording.frames[1];
  EXPECT_EQ(second.sequence, 1U);
  EXPECT_FALSE(second.has(Channel::velocity));
  EXPECT_EQ(second[Channel::velocity], 0.0);
  EXPECT_EQ(second[Channel::displacement], 4.0);
  EXPECT_EQ(recording.channels, 0b11);
}

TEST(Csv, DerivedColumnsAreLeftOut) {
  const Recording recording = parse_csv(
      "derived_coefficient,time_s,velocity_m_s,derived_expression\n"
      "0.3,0.001,-2.5,words\n,0.002,1,\n",
      "export");
  ASSERT_EQ(recording.frames.size(), 2U);
  EXPECT_EQ(recording.frames[0][Channel::velocity], -2.5);
  EXPECT_EQ(recording.frames[1][Channel::velocity], 1.0);
  EXPECT_EQ(recording.channels, 0b10);
  EXPECT_THROW(parse_csv("time_s,derived_coefficient\n1,0.3\n", "export"), InputError);
}

TEST(Csv, TimeIsReadAsDecimalAndRoundedToTheNanosecond) {
  EXPECT_EQ(time_of("0"), 0);
  EXPECT_EQ(time_of("-0.5"), -500'000'000);
  EXPECT_EQ(time_of(".25"), 250'000'000);
  EXPECT_EQ(time_of("3."), 3'000'000'000);
  EXPECT_EQ(time_of("+0.001"), 1'000'000);
  EXPECT_EQ(time_of("0.0000000004"), 0);
  EXPECT_EQ(time_of("0.0000000005"), 1);
  EXPECT_EQ(time_of("-0.00000000149999"), -1);
  // A double of this size is 238 ns from its neighbour.
  EXPECT_EQ(time_of("1700000000.123456789"), 1'700'000'000'123'456'789);
  EXPECT_EQ(time_of("1.700000000123456789e9"), 1'700'000'000'123'456'789);
  EXPECT_EQ(time_of("1700000000123456789E-9"), 1'700'000'000'123'456'789);
  EXPECT_EQ(time_of("1e-3"), 1'000'000);
  EXPECT_EQ(time_of("2.5e+01"), 25'000'000'000);
  EXPECT_EQ(time_of("1.000000000000000021e-03"), 1'000'000);  // as numpy writes it
  EXPECT_EQ(time_of("5e-10"), 1);
  EXPECT_EQ(time_of("5e-11"), 0);
  EXPECT_EQ(time_of("9223372036.854775807"), std::numeric_limits<std::int64_t>::max());
  EXPECT_EQ(time_of("-9223372036.854775808"), std::numeric_limits<std::int64_t>::min());
}

TEST(Csv, RefusesTimesBeyondTheClock) {
  for (const char* cell : {"9223372036.854775808", "-9223372036.854775809", "1e300", "1e99999",
                           "1e+-3", "18446744073.7095516155", "", ".", "-", "1e", "1.2.3", "0x10",
                           "1 2", "inf", "nan", "1s", "--1"}) {
    EXPECT_THROW(time_of(cell), InputError) << cell;
  }
}

TEST(Csv, ValuesAreReadAsFiniteNumbersOnly) {
  const auto value_of = [](const std::string& cell) {
    return parse_csv("time_s,velocity_m_s\n0," + cell + "\n", "t").frames.at(0)[Channel::velocity];
  };
  EXPECT_EQ(value_of("5e-324"), 5e-324);
  EXPECT_TRUE(std::signbit(value_of("-0")));
  EXPECT_EQ(value_of("1.7976931348623157e308"), std::numeric_limits<double>::max());
  for (const char* cell : {"1e999", "NaN", "-inf", "0x1p3", "1,5", "1;5", "+-1", "e5", "1e"}) {
    EXPECT_THROW(value_of(cell), InputError) << cell;
  }
}

TEST(Csv, WritesOnlyMeasuredChannelsAndExactTimes) {
  Recording recording;
  Frame frame;
  frame.time_ns = -1;
  frame.sequence = 77;
  frame.set(Channel::base_displacement, 0.1);
  recording.frames.push_back(frame);
  frame.time_ns = 1'700'000'000'123'456'789;
  frame.invalidate(Channel::base_displacement);
  frame.set(Channel::displacement, -0.0);
  recording.frames.push_back(frame);
  EXPECT_EQ(csv_of(recording),
            "time_s,displacement_m,base_displacement_m\n"
            "-0.000000001,,0.1\n"
            "1700000000.123456789,0,\n");
}

TEST(Csv, ABinaryFileIsRefusedInOneShortLine) {
  std::string rubbish;
  for (int i = 0; i < 100000; ++i) rubbish += static_cast<char>((i * 7919 % 251) | (i % 3 == 0));
  for (char& c : rubbish) {
    if (c == '\n') c = '\0';
  }
  try {
    parse_csv(rubbish, "t");
    FAIL() << "accepted";
  } catch (const InputError& error) {
    const std::string line = error.what();
    EXPECT_LT(line.size(), 400U);
    for (const char c : line) EXPECT_GE(static_cast<unsigned char>(c), 0x20);
  }
}

// Reading a minute at 1 kHz must not be noticeable. The bound is wide, since tests run in parallel.
TEST(Csv, AMinuteOfFiveChannelsIsReadQuickly) {
  std::string text =
      "time_s,displacement_m,velocity_m_s,friction_force_n,normal_load_n,base_displacement_m\n";
  for (int i = 0; i < 60000; ++i) {
    text += std::to_string(i / 1000) + "." + std::to_string(1000 + i % 1000).substr(1);
    for (int c = 0; c < 5; ++c) text += ",-0.012345678901234" + std::to_string((i * 31 + c) % 977);
    text += '\n';
  }
  const auto start = std::chrono::steady_clock::now();
  EXPECT_EQ(parse_csv(text, "t").frames.size(), 60000U);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(2));
}

TEST(Csv, AZeroHasNoSignAndALogKeepsIt) {
  Recording recording;
  recording.frames.resize(1);
  recording.frames[0].set(Channel::displacement, -0.0);
  std::ostringstream out;
  write_csv(recording, out);
  EXPECT_EQ(out.str(), "time_s,displacement_m\n0.000,0\n");
  const Folder folder;
  write_log(recording, folder / "r.log");
  EXPECT_TRUE(std::signbit(read_recording(folder / "r.log").frames[0][Channel::displacement]));
}

// A file that was cut may end within a number, which would be read as another one.
TEST(Csv, ALastLineWithoutNewlineIsNotRead) {
  const std::string whole = "time_s,displacement_m\n0.0,1.5\n0.1,1.2345\n";
  EXPECT_EQ(parse_csv(whole, "t.csv").cut_off_line, 0);
  for (std::size_t removed = 1; removed < 11; ++removed) {
    const Recording read = parse_csv(whole.substr(0, whole.size() - removed), "t.csv");
    EXPECT_EQ(read.frames.size(), 1U) << removed;
    EXPECT_EQ(read.cut_off_line, 3) << removed;
    EXPECT_EQ(read.cut_off_bytes, 11 - removed);
    EXPECT_EQ(cut_off_warning(read).substr(0, 9), "t.csv:3: ");
  }
  EXPECT_THROW(parse_csv("time_s,displacement_m\n0.0,1.5", "t.csv"), InputError);
  EXPECT_EQ(parse_csv(whole + "# end", "t.csv").cut_off_line, 0);
}

}  // namespace
}  // namespace stickslip::protocol
