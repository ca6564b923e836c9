// SPDX-License-Identifier: Apache-2.0
// Valid and corrupted lines of a serial scale; the count of missed lines.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cstdio>
#include <string>

#include "drivers/serial_scale/serial_scale.h"

namespace stickslip::drivers::serial_scale {
namespace {

constexpr std::int64_t ms = 1'000'000;

std::string with_checksum(const std::string& text) {
  unsigned sum = 0;
  for (const char each : text) sum ^= static_cast<unsigned char>(each);
  char ending[8];
  std::snprintf(ending, sizeof ending, " *%02X\r\n", sum & 0xFFU);
  return text + ending;
}

void expect_rejected(const std::string& line) {
  EXPECT_FALSE(parse_line(line)) << testing::PrintToString(line);
}

TEST(SerialScaleLine, IsAWeightInNewtons) {
  const auto stable = parse_line("S +00012.345 g *30\r\n");  // checksum derived by hand
  ASSERT_TRUE(stable);
  EXPECT_TRUE(stable->valid);
  EXPECT_NEAR(stable->force_n, 0.012345 * 9.80665, 1e-12);
  const auto in_motion = parse_line(with_checksum("M -1.5 kg"));
  ASSERT_TRUE(in_motion);
  EXPECT_TRUE(in_motion->valid);
  EXPECT_NEAR(in_motion->force_n, -1.5 * 9.80665, 1e-12);
}

TEST(SerialScaleLine, ErrorIsInvalid) {
  const auto error = parse_line(with_checksum("E -------- g"));
  ASSERT_TRUE(error);
  EXPECT_FALSE(error->valid);
}

TEST(SerialScaleLine, WrongFormatIsRejectedDespiteItsChecksum) {
  for (const char* text :
       {"",           "S",        "S  g",      "X +1.0 g",   "s +1.0 g",   "S 1.0 g",
        "S +1 g",     "S +1. g",  "S +.5 g",   "S +1.0.0 g", "S +1,0 g",   "S +1e3 g",
        "S +1.0e3 g", "S +inf g", "S +-1.0 g", "S + 1.0 g",  "S +1.0 lb",  "S +1.0 G",
        "S +1.0",     "S +1.0g",  "S  +1.0 g", "S +1.0  g",  "S +1.0 g ",  " S +1.0 g",
        "S ---- g",   "E +1.0 g", "E  g",      "E --.- g",   "S +1.0 g\n", "S +1.0 g\r"}) {
    expect_rejected(with_checksum(text));
  }
  expect_rejected(with_checksum(std::string("S +1.0\0 g", 9)));
  std::string long_number = "S +";
  long_number.append(60, '1').append(".0 g");
  expect_rejected(with_checksum(long_number));
}

TEST(SerialScaleLine, WrongEndingIsRejected) {
  for (const char* line :
       {"", "\n", "\r\n", " *00\r\n", "S +00012.345 g *31\r\n", "S +00012.345 g *30\n",
        "S +00012.345 g *30", "S +00012.345 g *3\r\n", "S +00012.345 g *030\r\n",
        "S +00012.345 g 30\r\n", "S +00012.345 g*30\r\n", "S +00012.345 g *30 \r\n",
        "S +00012.345 g *30\r\n\r\n"}) {
    expect_rejected(line);
  }
  EXPECT_TRUE(parse_line("M -2.5 g *2E\r\n"));
  expect_rejected("M -2.5 g *2e\r\n");
}

/// A valid line without an error, and its content.
std::string any_line() {
  const int digits = *rc::gen::inRange(0, 100'000'000);
  char number[16];
  std::snprintf(number, sizeof number, "%05d.%03d", digits / 1000, digits % 1000);
  return with_checksum(std::string(*rc::gen::element("S", "M")) + " " +
                       *rc::gen::element("+", "-") + number + " " + *rc::gen::element("g", "kg"));
}

char other_than(char was) {
  return static_cast<char>(
      *rc::gen::suchThat(rc::gen::arbitrary<char>(), [was](char each) { return each != was; }));
}

RC_GTEST_PROP(SerialScaleLineProperty, ChangedLostOrAddedByteIsDetected, ()) {
  std::string line = any_line();
  RC_ASSERT(parse_line(line).has_value());
  const auto at = *rc::gen::inRange<std::size_t>(0, line.size());
  switch (*rc::gen::inRange(0, 3)) {
    case 0:
      line[at] = other_than(line[at]);
      break;
    case 1:
      line.erase(at, 1);
      break;
    default:
      line.insert(at, 1, *rc::gen::arbitrary<char>());
  }
  RC_ASSERT(!parse_line(line));
}

RC_GTEST_PROP(SerialScaleLineProperty, BurstOfEightBitsIsDetected, ()) {
  std::string line = any_line();
  const auto burst = *rc::gen::inRange(1U, 256U);
  const auto first = *rc::gen::inRange<std::size_t>(0, 8 * line.size() - 8);
  for (std::size_t i = 0; i < 8; ++i) {  // the least significant bit is transmitted first
    if ((burst >> i & 1U) == 0) continue;
    const std::size_t bit = first + i;
    line[bit / 8] = static_cast<char>(line[bit / 8] ^ (1 << bit % 8));
  }
  RC_ASSERT(!parse_line(line));
}

RC_GTEST_PROP(SerialScaleLineProperty, FragmentsAreRejected, ()) {
  const std::string line = any_line();
  const std::string other = any_line();
  const auto cut = *rc::gen::inRange<std::size_t>(1, line.size());
  RC_ASSERT(!parse_line(line.substr(cut)));
  RC_ASSERT(!parse_line(line.substr(0, cut)));
  RC_ASSERT(!parse_line(line + other));
  RC_ASSERT(!parse_line(line.substr(0, cut) + other));
}

// With errors in many bytes the checksum is valid by chance in one of 256 cases; then only the
// format is left as a check.
RC_GTEST_PROP(SerialScaleLineProperty, ArbitraryBytesAreRejectedWithoutAValidChecksum, ()) {
  std::string line = any_line();
  const std::string before = line;
  for (int n = *rc::gen::inRange(1, 9); n > 0; --n) {
    line[*rc::gen::inRange<std::size_t>(0, line.size())] = *rc::gen::arbitrary<char>();
  }
  const bool checksum_valid = line == with_checksum(line.substr(0, line.size() - 6));
  RC_ASSERT(checksum_valid || !parse_line(line));
  RC_CLASSIFY(checksum_valid && line != before, "checksum valid by chance");
}

TEST(MissedMessages, CountsNoneForLinesWithJitter) {
  for (const std::int64_t interval : {80 * ms, 100 * ms, 120 * ms}) {
    MissedMessages missed(100'000'000, 0);
    const std::int64_t late[] = {0, 30 * ms, 5 * ms, 50 * ms, 0, 12 * ms};
    for (int i = 1; i < 500; ++i) {
      EXPECT_EQ(missed.count(i * interval + late[i % 6], 1), 0U) << interval << " " << i;
    }
  }
}

TEST(MissedMessages, CountsTheMessagesOfAGapOnce) {
  MissedMessages missed(100'000'000, 0);
  for (int i = 1; i <= 20; ++i) EXPECT_EQ(missed.count(i * 100 * ms, 1), 0U);
  EXPECT_EQ(missed.count(2400 * ms, 1), 3U);
  EXPECT_EQ(missed.count(2500 * ms, 1), 0U);
  // Missed messages are counted during a gap, and not again at its end.
  EXPECT_EQ(missed.count(2670 * ms, 0), 0U);
  EXPECT_EQ(missed.count(2680 * ms, 0), 1U);
  EXPECT_EQ(missed.count(2990 * ms, 0), 3U);
  EXPECT_EQ(missed.count(3000 * ms, 1), 0U);
}

TEST(MissedMessages, LateBurstsAreNotMissed) {
  MissedMessages missed(100'000'000, 0);
  for (int i = 1; i <= 20; ++i) missed.count(i * 100 * ms, 1);
  EXPECT_EQ(missed.count(2500 * ms, 5), 0U);
  EXPECT_EQ(missed.count(3000 * ms, 3), 2U);
}

}  // namespace
}  // namespace stickslip::drivers::serial_scale
