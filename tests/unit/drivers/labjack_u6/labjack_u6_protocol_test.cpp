// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack_u6/protocol.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace stickslip::drivers::labjack_u6 {
namespace {

using Bytes = std::vector<std::uint8_t>;
using Kind = Verdict::Kind;

Bytes bytes_of(const Command& command) { return {command.view().begin(), command.view().end()}; }

/// A message of a board: extended framing of `body` (from byte 6).
Bytes extended_reply(std::uint8_t function, Bytes body) {
  if (body.size() % 2 != 0) body.push_back(0);
  unsigned sum16 = 0;
  for (const auto byte : body) sum16 += byte;
  Bytes reply{0,
              0xF8,
              static_cast<std::uint8_t>(body.size() / 2),
              function,
              static_cast<std::uint8_t>(sum16),
              static_cast<std::uint8_t>(sum16 >> 8U)};
  unsigned sum8 = 0;
  for (std::size_t i = 1; i < 6; ++i) sum8 += reply[i];
  sum8 = sum8 / 256 + sum8 % 256;
  reply[0] = static_cast<std::uint8_t>(sum8 / 256 + sum8 % 256);
  reply.insert(reply.end(), body.begin(), body.end());
  return reply;
}

Bytes identity_reply() {
  Bytes body(32, 0);
  body[9 - 6] = 43;
  body[10 - 6] = 1;
  body[15 - 6] = 0x94;  // 360009876 = 0x15755094, the lowest byte first
  body[16 - 6] = 0x50;
  body[17 - 6] = 0x75;
  body[18 - 6] = 0x15;
  body[19 - 6] = 6;
  body[37 - 6] = 12;
  return extended_reply(0x08, body);
}

void put_constant(CalibrationBlock& block, std::size_t place, double value) {
  const auto fixed = static_cast<std::int64_t>(std::llround(value * 4294967296.0));
  for (std::size_t i = 0; i < 8; ++i) {
    block[8 * place + i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(fixed) >> (8 * i));
  }
}

std::array<CalibrationBlock, calibration_blocks> nominal_blocks() {
  const Calibration nominal = nominal_calibration();
  std::array<CalibrationBlock, calibration_blocks> blocks{};
  for (std::size_t gain = 0; gain < 4; ++gain) {
    put_constant(blocks[gain / 2], gain % 2 * 2, nominal.positive_slope_v[gain]);
    put_constant(blocks[2 + gain / 2], gain % 2 * 2, nominal.negative_slope_v[gain]);
    put_constant(blocks[2 + gain / 2], gain % 2 * 2 + 1, nominal.center[gain]);
  }
  put_constant(blocks[4], 0, 13210.5);
  put_constant(blocks[4], 1, -3.25);
  put_constant(blocks[4], 2, 13190.0);
  put_constant(blocks[4], 3, 12.0);
  return blocks;
}

TEST(LabjackU6Checksum, CarriesAreAddedBackIn) {
  EXPECT_EQ(checksum8(Bytes{0xFF, 0x01}), 0x01);
  EXPECT_EQ(checksum8(Bytes{0xFF, 0xFF, 0xFF, 0xFF, 0xFF}), 0xFF);
  EXPECT_EQ(checksum8(Bytes{0xF8, 0x0A, 0x08, 0, 0}), 0x0B);
  EXPECT_EQ(checksum16(Bytes(300, 0xFF)), 300 * 255 % 65536);
}

// Derived by hand from the layouts.
TEST(LabjackU6Command, HasTheBytesOfTheReference) {
  Bytes identity(26, 0);
  identity[0] = 0x0B;
  identity[1] = 0xF8;
  identity[2] = 0x0A;
  identity[3] = 0x08;
  EXPECT_EQ(bytes_of(request_identity()), identity);
  EXPECT_EQ(bytes_of(request_calibration(4)), (Bytes{0x2B, 0xF8, 1, 0x2D, 4, 0, 0, 4}));
  EXPECT_EQ(bytes_of(start_stream()), (Bytes{0xA8, 0xA8}));
  EXPECT_EQ(bytes_of(stop_stream()), (Bytes{0xB0, 0xB0}));
  EXPECT_EQ(bytes_of(arm_watchdog(0x0102, 3)),
            (Bytes{0x1E, 0xF8, 5, 9, 0x17, 0, 1, 0x10, 2, 1, 3, 0, 0, 0, 0, 0}));
  EXPECT_EQ(bytes_of(plain_lines()), extended_reply(0x0B, {1, 0, 0, 0, 0, 0, 0, 0, 0, 0}));
}

TEST(LabjackU6Command, AStreamIsConfiguredChannelByChannel) {
  const std::vector<StreamChannel> channels{{0, false, 0}, {4, true, 2}, {13, false, 3}};
  const Command command = configure_stream(channels, 1, 25, 2, {48'000'000, 48000, 8});
  EXPECT_EQ(bytes_of(command),
            extended_reply(0x11, {3, 1, 25, 0, 2, 8, 0x80, 0xBB, 0, 0, 4, 0xA0, 13, 0x30}));
}

TEST(LabjackU6Command, FeedbackHoldsItsOperationsInOrder) {
  const Command command = Feedback(0x5A).set_line(2, true).dac(1, 0x1234).read_lines().command();
  EXPECT_EQ(bytes_of(command), extended_reply(0, {0x5A, 11, 0x82, 39, 0x34, 0x12, 26, 0}));
  EXPECT_EQ(bytes_of(Feedback(1).dac(0, 7).command()), extended_reply(0, {1, 38, 7, 0}));
  EXPECT_EQ(bytes_of(Feedback(1).make_input(19).command()), extended_reply(0, {1, 13, 19, 0}));
}

TEST(LabjackU6Command, FeedbackNeverGrowsBeyondAPacket) {
  Feedback feedback(0);
  for (int i = 0; i < 100; ++i) feedback.dac(0, 1);
  EXPECT_LE(feedback.command().size, largest_packet);
}

TEST(LabjackU6Reply, IdentifiesTheBoard) {
  Identity identity;
  ASSERT_TRUE(parse_identity(identity_reply(), identity));
  EXPECT_EQ(identity.serial, 360009876U);
  EXPECT_EQ(identity.product, 6);
  EXPECT_EQ(name_of(identity), "LabJack U6-Pro #360009876");
  EXPECT_EQ(firmware_of(identity), "1.43");
}

TEST(LabjackU6Reply, EveryErrorHasItsVerdict) {
  Identity identity;
  const Bytes good = identity_reply();
  const auto verdict = [&](const Bytes& reply) { return parse_identity(reply, identity).kind; };
  EXPECT_EQ(verdict({0xB8, 0xB8}), Kind::refused);
  EXPECT_EQ(verdict({}), Kind::length);
  EXPECT_EQ(verdict(Bytes(good.begin(), good.end() - 1)), Kind::length);
  EXPECT_EQ(verdict(extended_reply(0x0B, Bytes(32, 0))), Kind::command);
  EXPECT_EQ(verdict(extended_reply(0x08, Bytes(30, 0))), Kind::length);
  Bytes other_length = extended_reply(0x08, Bytes(32, 0));
  other_length[2] ^= 1U;
  EXPECT_EQ(verdict(other_length), Kind::checksum);
  Bytes failed(32, 0);
  failed[0] = 48;
  EXPECT_EQ(verdict(extended_reply(0x08, failed)), Kind::error);
  EXPECT_EQ(in_words(parse_identity(extended_reply(0x08, failed), identity)),
            "error 48 (the stream is running)");
}

RC_GTEST_PROP(LabjackU6Reply, SingleBitErrorIsRejected, ()) {
  Bytes reply = identity_reply();
  const auto at = *rc::gen::inRange<std::size_t>(0, reply.size());
  const auto bit = *rc::gen::inRange(0U, 8U);
  reply[at] = static_cast<std::uint8_t>(reply[at] ^ (1U << bit));
  Identity identity;
  RC_ASSERT(!parse_identity(reply, identity));
}

TEST(LabjackU6Reply, StreamStartAndStopAreFourBytes) {
  EXPECT_TRUE(check_stream_started(Bytes{0xA9, 0xA9, 0, 0}));
  EXPECT_TRUE(check_stream_stopped(Bytes{0xB1, 0xB1, 0, 0}));
  EXPECT_EQ(check_stream_started(Bytes{0xB1, 0xB1, 0, 0}).kind, Kind::command);
  EXPECT_EQ(check_stream_started(Bytes{0xA8, 0xA9, 0, 0}).kind, Kind::checksum);
  EXPECT_EQ(check_stream_started(Bytes{0xA9, 0xA9, 0}).kind, Kind::length);
  const Verdict not_running = check_stream_stopped(Bytes{0xE5, 0xB1, 52, 0});
  EXPECT_EQ(not_running.kind, Kind::error);
  EXPECT_EQ(not_running.code, 52);
}

TEST(LabjackU6Reply, FeedbackReturnsLinesAndEcho) {
  FeedbackReply reply;
  ASSERT_TRUE(parse_feedback(extended_reply(0, {0, 0, 0x5A, 0x01, 0x80, 0x0F}), true, reply));
  EXPECT_EQ(reply.echo, 0x5A);
  EXPECT_EQ(reply.lines, 0x0F8001U);
  ASSERT_TRUE(parse_feedback(extended_reply(0, {0, 0, 7}), false, reply));
  EXPECT_EQ(reply.echo, 7);
  EXPECT_EQ(parse_feedback(extended_reply(0, {0, 0, 7}), true, reply).kind, Kind::length);
  const Verdict failed = parse_feedback(extended_reply(0, {98, 2, 9, 0}), true, reply);
  EXPECT_EQ(failed.kind, Kind::error);
  EXPECT_EQ(failed.code, 98);
  EXPECT_EQ(failed.position, 2);
  EXPECT_EQ(reply.echo, 9);
}

TEST(LabjackU6Calibration, IsReadAsFixedPoint) {
  const Calibration calibration = calibration_of(nominal_blocks());
  const Calibration nominal = nominal_calibration();
  for (std::size_t gain = 0; gain < 4; ++gain) {
    EXPECT_NEAR(calibration.positive_slope_v[gain], nominal.positive_slope_v[gain], 2.4e-10);
    EXPECT_NEAR(calibration.negative_slope_v[gain], nominal.negative_slope_v[gain], 2.4e-10);
    EXPECT_EQ(calibration.center[gain], 33523.0);
  }
  EXPECT_EQ(calibration.dac_slope[0], 13210.5);
  EXPECT_EQ(calibration.dac_offset[0], -3.25);
  EXPECT_EQ(calibration.dac_slope[1], 13190.0);
  EXPECT_EQ(calibration.dac_offset[1], 12.0);
  EXPECT_EQ(implausible_constant(calibration), "");
}

TEST(LabjackU6Calibration, ImplausibleMemoryIsReported) {
  std::array<CalibrationBlock, calibration_blocks> blocks{};
  EXPECT_THAT(implausible_constant(calibration_of(blocks)),
              testing::HasSubstr("slope for positive"));
  for (auto& block : blocks) block.fill(0xFF);
  EXPECT_NE(implausible_constant(calibration_of(blocks)), "");
  blocks = nominal_blocks();
  put_constant(blocks[3], 3, 12345.0);
  EXPECT_EQ(implausible_constant(calibration_of(blocks)),
            "the center of gain 3 is 12345, nominal is 33523");
  blocks = nominal_blocks();
  put_constant(blocks[4], 2, 6600.0);
  EXPECT_THAT(implausible_constant(calibration_of(blocks)), testing::HasSubstr("slope of DAC 1"));
}

TEST(LabjackU6Calibration, CountsAreVoltsOnBothSidesOfTheCenter) {
  Calibration calibration = nominal_calibration();
  EXPECT_EQ(volts(calibration, 0, 33523), 0.0);
  EXPECT_NEAR(volts(calibration, 0, 65535), 10.1096, 1e-3);
  EXPECT_NEAR(volts(calibration, 0, 0), -10.5867, 1e-3);
  EXPECT_NEAR(volts(calibration, 3, 33523 + 1000), 3.158e-4, 1e-7);
  calibration.negative_slope_v[1] = -4e-5;
  EXPECT_NEAR(volts(calibration, 1, 33523 - 100), -4e-3, 1e-12);
  EXPECT_NEAR(volts(calibration, 1, 33523 + 100), 3.1580578e-3, 1e-12);
}

TEST(LabjackU6Calibration, TheDacStaysInItsRange) {
  const Calibration calibration = nominal_calibration();
  EXPECT_EQ(dac_counts(calibration, 0, 2.5), 33000);
  EXPECT_EQ(dac_counts(calibration, 0, -1.0), 0);
  EXPECT_EQ(dac_counts(calibration, 1, 12.0), 65535);
  EXPECT_EQ(dac_counts(calibration, 1, std::numeric_limits<double>::quiet_NaN()), 0);
}

TEST(LabjackU6Clock, TheRatesOfABenchAreExact) {
  for (const double rate_hz : {50.0, 100.0, 125.0, 150.0, 200.0, 250.0, 500.0, 1000.0, 2000.0}) {
    EXPECT_EQ(nearest_clock(rate_hz).rate_hz(), rate_hz);
  }
  EXPECT_EQ(nearest_clock(1000.0).hz, 48'000'000U);
  EXPECT_EQ(nearest_clock(1000.0).config_bits, 8);
  EXPECT_EQ(nearest_clock(100.0).hz, 4'000'000U);
  EXPECT_EQ(nearest_clock(10.0).config_bits, 0x0A);
  EXPECT_EQ(nearest_clock(1.0).config_bits, 0x02);
}

TEST(LabjackU6Clock, LimitsShowInTheDeviation) {
  EXPECT_GT(deviation(nearest_clock(0.1), 0.1), 1.0);
  EXPECT_LT(deviation(nearest_clock(0.2385), 0.2385), 1e-3);
}

RC_GTEST_PROP(LabjackU6Clock, EveryRateOfAStreamIsWithinItsResolution, ()) {
  const double rate_hz = *rc::gen::inRange(1, 500000) * 0.1 + 1.0;
  const ScanClock clock = nearest_clock(rate_hz);
  // Half a step of the slowest clock in use: 4 MHz / 256 below 2.86 Hz.
  RC_ASSERT(deviation(clock, rate_hz) < 0.5 / clock.interval * 1.001);
  RC_ASSERT(clock.interval >= 1);
}

RC_GTEST_PROP(LabjackU6Clock, TimesAreMultiplesOfTheExactPeriod, ()) {
  const ScanClock clock = nearest_clock(*rc::gen::inRange(1, 50000));
  const auto scan = *rc::gen::inRange<std::uint64_t>(0, std::uint64_t{1} << 33U);
  const long double exact =
      static_cast<long double>(scan) * clock.interval * 1.0e9L / static_cast<long double>(clock.hz);
  RC_ASSERT(std::abs(static_cast<long double>(clock.time_ns(scan)) - exact) <= 0.51L);
}

TEST(LabjackU6Input, IsNamedAsOnTheBoard) {
  EXPECT_EQ(input_named("AIN0"), 0);
  EXPECT_EQ(input_named("AIN13"), 13);
  for (const char* wrong : {"AIN14", "AIN", "ain0", "AIN00", "AIN-1", "0", "AIN1 "}) {
    EXPECT_EQ(input_named(wrong), std::nullopt) << wrong;
  }
  EXPECT_EQ(gain_of(10.0), 0);
  EXPECT_EQ(gain_of(0.01), 3);
  EXPECT_EQ(gain_of(5.0), std::nullopt);
}

}  // namespace
}  // namespace stickslip::drivers::labjack_u6
