// SPDX-License-Identifier: Apache-2.0
#include "drivers/phidget_bridge/protocol.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <random>
#include <vector>

namespace stickslip::drivers::phidget_bridge {
namespace {

using testing::ElementsAre;

constexpr std::int64_t ms = 1'000'000;

Settings settings_of(unsigned mask, std::array<int, 4> gain, int interval_ms) {
  Settings settings;
  for (unsigned i = 0; i < 4; ++i) settings.enabled[i] = (mask >> i & 1U) != 0;
  settings.gain = gain;
  settings.interval_ms = interval_ms;
  return settings;
}

/// A report of the board, by the protocol and not by the parser.
std::vector<std::uint8_t> report_of(const Settings& settings) {
  std::vector<std::uint8_t> bytes(18);
  const auto code = [](int gain) {
    unsigned code = 0;
    while (gain > 1) {
      gain /= 2;
      ++code;
    }
    return code;
  };
  for (unsigned i = 0; i < 4; ++i) {
    if (settings.enabled[i]) bytes[0] = static_cast<std::uint8_t>(bytes[0] + 0x11 * (1 << i));
    bytes[6 + 3 * i] = 0x80;
  }
  bytes[2] = static_cast<std::uint8_t>(16 * code(settings.gain[0]) + code(settings.gain[1]));
  bytes[3] = static_cast<std::uint8_t>(16 * code(settings.gain[2]) + code(settings.gain[3]));
  bytes[4] = static_cast<std::uint8_t>(settings.interval_ms / 8 / 256);
  bytes[5] = static_cast<std::uint8_t>(settings.interval_ms / 8 % 256);
  return bytes;
}

TEST(PhidgetBridgeSettings, IntervalIsLittleEndian) {
  EXPECT_THAT(output_report(settings_of(0b0101, {128, 1, 8, 64}, 1000)),
              ElementsAre(0x05, 0x70, 0x36, 125, 0));
  EXPECT_THAT(output_report(settings_of(0b1010, {16, 32, 1, 1}, 8)),
              ElementsAre(0x0A, 0x45, 0x00, 1, 0));
}

TEST(PhidgetBridgeReport, IntervalIsBigEndian) {
  auto bytes = report_of(settings_of(0b0011, {128, 8, 1, 1}, 80));
  bytes[1] = 0x02;
  bytes[9] = 0x7F;
  bytes[10] = 0xFF;
  bytes[11] = 0xFE;
  const auto report = parse_input(bytes);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->settings, settings_of(0b0011, {128, 8, 1, 1}, 80));
  EXPECT_TRUE(report->error[1]);
  EXPECT_FALSE(report->error[0]);
  EXPECT_EQ(report->raw[1], 0x7FFFFEU);
}

TEST(PhidgetBridgeReport, MalformedReportsAreRejected) {
  auto bytes = report_of(settings_of(1, {1, 1, 1, 1}, 8));
  EXPECT_TRUE(parse_input(bytes));
  bytes[2] = 0x10;  // a gain of 2
  EXPECT_FALSE(parse_input(bytes));
  bytes[2] = 0;
  bytes.resize(17);
  EXPECT_FALSE(parse_input(bytes));
  EXPECT_FALSE(parse_input({}));
}

TEST(PhidgetBridgeReading, IsARatioWithinTheRange) {
  EXPECT_EQ(ratio(0x800000, 128), 0.0);
  EXPECT_EQ(ratio(0xC00000, 1), 0.5);
  EXPECT_EQ(ratio(0, 8), -0.125);
  auto bytes = report_of(settings_of(0b0011, {128, 1, 1, 1}, 8));
  const auto is_valid_input = [&bytes](std::size_t input) {
    return is_valid(*parse_input(bytes), input);
  };
  EXPECT_TRUE(is_valid_input(0));
  EXPECT_FALSE(is_valid_input(2)) << "not enabled";
  bytes[6] = 0xFF;
  bytes[7] = 0x5B;
  EXPECT_TRUE(is_valid_input(0)) << "0.99498 of the range";
  bytes[7] = 0x5D;
  EXPECT_FALSE(is_valid_input(0)) << "0.99503 of the range";
  bytes[1] = 0x02;
  EXPECT_FALSE(is_valid_input(1)) << "reported by the board";
  bytes[1] = 0;
  EXPECT_TRUE(is_valid_input(1));
  bytes[0] = 0x13;
  EXPECT_FALSE(is_valid_input(1)) << "not measured";
}

TEST(PhidgetBridgeFirmware, IsDecodedLikeTheManufacturer) {
  EXPECT_EQ(firmware_of(0x0001), 100);
  EXPECT_EQ(firmware_of(0x0002), 200);
  EXPECT_EQ(firmware_of(0x0100), 100);
  EXPECT_EQ(firmware_of(0x0102), 102);
  EXPECT_EQ(firmware_of(0x0110), 116);
  EXPECT_EQ(firmware_of(0x0200), 200);
  EXPECT_FALSE(firmware_of(0));
}

TEST(PhidgetBridgeDescriptor, HoldsTheLengthOfTheOutput) {
  const std::vector<std::uint8_t> descriptor = {
      0x06, 0x00, 0xFF, 0x09, 0x01, 0xA1, 0x01, 0x15, 0x00, 0x26, 0xFF, 0x00, 0x75, 0x08,
      0x95, 0x12, 0x09, 0x02, 0x81, 0x02, 0x95, 0x05, 0x09, 0x03, 0x91, 0x02, 0xC0};
  EXPECT_EQ(output_report_bytes(descriptor), 5U);
  EXPECT_EQ(output_report_bytes({}), 0U);
  EXPECT_EQ(output_report_bytes(std::vector<std::uint8_t>{0x91}), 0U);
}

TEST(PhidgetBridgeHandshake, WaitsForTheEchoAndOneMoreSample) {
  const Settings wanted = settings_of(0b0010, {1, 64, 1, 1}, 8);
  const auto old = *parse_input(report_of(settings_of(0b1111, {1, 1, 1, 1}, 8)));
  const auto echo = *parse_input(report_of(wanted));
  Handshake handshake(wanted, 110);
  handshake.take(echo);  // before the first output report
  EXPECT_EQ(handshake.to_send(), output_report(wanted));
  EXPECT_FALSE(handshake.to_send());
  handshake.take(old);
  handshake.take(old);
  EXPECT_FALSE(handshake.done());
  handshake.repeat();
  EXPECT_EQ(handshake.to_send(), output_report(wanted));
  handshake.take(echo);
  EXPECT_FALSE(handshake.done());
  handshake.take(echo);
  EXPECT_TRUE(handshake.done());
  handshake.take(old);  // it has lost its settings
  EXPECT_FALSE(handshake.done());
  EXPECT_EQ(handshake.to_send(), output_report(wanted));
}

TEST(PhidgetBridgeHandshake, DoesNotCompareTheInterval) {
  const Settings wanted = settings_of(0b0010, {1, 64, 1, 1}, 8);
  const auto slower = *parse_input(report_of(settings_of(0b0010, {1, 64, 1, 1}, 400)));
  Handshake handshake(wanted, 110);
  EXPECT_EQ(handshake.to_send(), output_report(wanted));
  handshake.take(slower);
  handshake.take(slower);
  EXPECT_TRUE(handshake.done());
}

TEST(PhidgetBridgeHandshake, KeepsInputZeroEnabledIfFirmwareNeedsIt) {
  const Settings wanted = settings_of(0b0010, {1, 64, 1, 1}, 8);
  const Settings first = settings_of(0b0011, {1, 64, 1, 1}, 8);
  Handshake handshake(wanted, 101);
  EXPECT_EQ(handshake.to_send(), output_report(first));
  const auto echo = *parse_input(report_of(first));
  handshake.take(echo);
  for (int i = 0; i < 31; ++i) {
    handshake.take(echo);
    EXPECT_FALSE(handshake.to_send()) << i;
  }
  handshake.take(echo);
  EXPECT_EQ(handshake.to_send(), output_report(wanted));
  const auto last = *parse_input(report_of(wanted));
  handshake.take(last);
  EXPECT_FALSE(handshake.done());
  handshake.take(last);
  EXPECT_TRUE(handshake.done());
}

TEST(PhidgetBridgeGaps, AreCountedExactly) {
  GapCounter gaps(8 * ms);
  EXPECT_EQ(gaps.count(0, 1), 0U);
  EXPECT_EQ(gaps.count(8 * ms, 1), 0U);
  EXPECT_EQ(gaps.count(32 * ms, 1), 2U);
  EXPECT_EQ(gaps.count(40 * ms, 1), 0U);
  EXPECT_EQ(gaps.count(80 * ms, 5), 0U);  // a burst of five
  EXPECT_EQ(gaps.count(120 * ms, 4), 1U);
}

RC_GTEST_PROP(PhidgetBridgeGaps, JitterOfHalfAnIntervalDoesNotCount, (std::uint32_t seed)) {
  std::mt19937 random(seed);
  const auto below = [&random](std::int64_t n) {
    return static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(n));
  };
  const std::int64_t interval = 8 * ms * (1 + below(20));
  const double crystal = 1.0 + 1e-4 * (static_cast<double>(below(201)) - 100.0) / 100.0;
  GapCounter gaps(interval);
  std::uint64_t missing = 0;
  std::uint64_t lost = 0;
  std::uint64_t lost_at_end = 0;  // not counted yet
  for (int i = 0; i < 5000; ++i) {
    if (i > 0 && below(50) == 0) {
      ++lost;
      ++lost_at_end;
      continue;
    }
    lost_at_end = 0;
    const auto due =
        static_cast<std::int64_t>(static_cast<double>(i) * static_cast<double>(interval) * crystal);
    missing += gaps.count(due + below(interval / 2), 1);
  }
  RC_ASSERT(missing + lost_at_end == lost);
}

RC_GTEST_PROP(PhidgetBridgeReport, ParsedReportsHoldValidSettings,
              (const std::vector<std::uint8_t>& bytes)) {
  const auto report = parse_input(bytes);
  if (!report) return;
  for (std::size_t i = 0; i < input_count; ++i) {
    RC_ASSERT(is_gain(report->settings.gain[i]));
    RC_ASSERT(report->raw[i] < 0x1000000U);
  }
}

}  // namespace
}  // namespace stickslip::drivers::phidget_bridge
