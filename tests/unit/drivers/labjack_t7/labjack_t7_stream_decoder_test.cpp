// SPDX-License-Identifier: Apache-2.0
// Packets of a LabJack T7 become scans with exact numbers, whatever the board skips.
#include "drivers/labjack_t7/stream_decoder.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace stickslip::drivers::labjack_t7 {
namespace {

using Outcome = StreamDecoder::Outcome;

/// A packet and its bytes.
struct Sent {
  std::vector<std::uint8_t> bytes;
  StreamPacket packet;
};

Sent packet(std::uint16_t number, const std::vector<std::uint16_t>& samples,
            std::uint16_t status = 0, std::uint16_t information = 0) {
  Sent out;
  for (const std::uint16_t sample : samples) {
    out.bytes.push_back(static_cast<std::uint8_t>(sample >> 8U));
    out.bytes.push_back(static_cast<std::uint8_t>(sample & 0xFFU));
  }
  out.packet = {number, 0, status, information, out.bytes};
  return out;
}

std::vector<std::uint64_t> numbers(const StreamDecoder& decoder) {
  std::vector<std::uint64_t> out;
  for (const Scan& scan : decoder.scans()) out.push_back(scan.index);
  return out;
}

using Numbers = std::vector<std::uint64_t>;
constexpr std::uint16_t none = 0xFFFF;

TEST(LabjackT7StreamDecoder, ScansMayStraddlePackets) {
  StreamDecoder decoder(2, 3);
  ASSERT_EQ(decoder.take(packet(0, {10, 20, 11}).packet), Outcome::ok);
  EXPECT_EQ(numbers(decoder), (Numbers{0}));
  ASSERT_EQ(decoder.take(packet(1, {21, 12, 22}).packet), Outcome::ok);
  ASSERT_EQ(numbers(decoder), (Numbers{1, 2}));
  EXPECT_EQ(decoder.scans()[0].counts[0], 11);
  EXPECT_EQ(decoder.scans()[0].counts[1], 21);
}

TEST(LabjackT7StreamDecoder, SkippedScansAreCountedAndTheirMarkIsNoScan) {
  StreamDecoder decoder(2, 4);
  ASSERT_EQ(decoder.take(packet(0, {1, 2, 3, 4}).packet), Outcome::ok);
  ASSERT_EQ(decoder.take(packet(1, {1, 2, 3, 4}, auto_recovery_active).packet), Outcome::ok);
  ASSERT_EQ(decoder.take(packet(2, {5, 6, none, none}, auto_recovery_end, 100).packet),
            Outcome::ok);
  EXPECT_EQ(numbers(decoder), (Numbers{4}));
  ASSERT_EQ(decoder.take(packet(3, {7, 8, 9, 10}).packet), Outcome::ok);
  EXPECT_EQ(numbers(decoder), (Numbers{105, 106}));
  EXPECT_EQ(decoder.counts().overflows, 1U);
  EXPECT_EQ(decoder.counts().overflow_losses, 100U);
  EXPECT_EQ(decoder.counts().scans_lost, 100U);
}

TEST(LabjackT7StreamDecoder, TheMarkMayFollowTheReport) {
  StreamDecoder decoder(1, 2);
  ASSERT_EQ(decoder.take(packet(0, {1, 2}, auto_recovery_active).packet), Outcome::ok);
  ASSERT_EQ(decoder.take(packet(1, {3, 4}, auto_recovery_end, 7).packet), Outcome::ok);
  EXPECT_EQ(numbers(decoder), (Numbers{2, 3}));
  ASSERT_EQ(decoder.take(packet(2, {none, 5}).packet), Outcome::ok);
  EXPECT_EQ(numbers(decoder), (Numbers{11}));
}

TEST(LabjackT7StreamDecoder, LossesThatCannotBeCountedEndTheStream) {
  StreamDecoder unreported(1, 2);
  EXPECT_EQ(unreported.take(packet(0, {1, none}).packet), Outcome::uncountable);
  EXPECT_EQ(unreported.counts().scans, 0U);
  EXPECT_EQ(unreported.take(packet(1, {1, 2}).packet), Outcome::uncountable);
  StreamDecoder overflow(1, 2);
  EXPECT_EQ(overflow.take(packet(0, {1, 2}, auto_recovery_overflow).packet), Outcome::uncountable);
  StreamDecoder twice(1, 2);
  ASSERT_EQ(twice.take(packet(0, {1, 2}, auto_recovery_end, 5).packet), Outcome::ok);
  EXPECT_EQ(twice.take(packet(1, {1, 2}, auto_recovery_end, 5).packet), Outcome::uncountable);
  StreamDecoder far(1, 2);
  EXPECT_EQ(far.take(packet(5000, {1, 2}).packet), Outcome::uncountable);
  StreamDecoder report_lost(1, 2);
  ASSERT_EQ(report_lost.take(packet(0, {1, 2}, auto_recovery_active).packet), Outcome::ok);
  EXPECT_EQ(report_lost.take(packet(2, {1, 2}).packet), Outcome::uncountable);
}

TEST(LabjackT7StreamDecoder, MissingPacketsCostTheirScans) {
  StreamDecoder decoder(2, 4);
  ASSERT_EQ(decoder.take(packet(0, {1, 2, 3, 4}).packet), Outcome::ok);
  ASSERT_EQ(decoder.take(packet(3, {5, 6, 7, 8}).packet), Outcome::ok);
  EXPECT_EQ(numbers(decoder), (Numbers{6, 7}));
  EXPECT_EQ(decoder.counts().packets_lost, 2U);
  EXPECT_EQ(decoder.counts().scans_lost, 4U);
}

TEST(LabjackT7StreamDecoder, NumbersOfPacketsWrap) {
  StreamDecoder decoder(1, 1);
  std::uint64_t scans = 0;
  for (std::uint32_t i = 0; i < 70000; ++i) {
    ASSERT_EQ(decoder.take(packet(static_cast<std::uint16_t>(i), {1}).packet), Outcome::ok);
    scans += decoder.scans().size();
  }
  EXPECT_EQ(scans, 70000U);
  EXPECT_EQ(decoder.counts().scans_lost, 0U);
}

TEST(LabjackT7StreamDecoder, OtherStatusIsAnErrorOfTheBoard) {
  StreamDecoder decoder(1, 1);
  EXPECT_EQ(decoder.take(packet(0, {1}, 2942).packet), Outcome::error);
  EXPECT_EQ(decoder.status(), 2942);
  EXPECT_TRUE(decoder.scans().empty());
}

// Whatever a board sends: numbers increase, and no scan is beyond the buffer.
TEST(LabjackT7StreamDecoder, AnyPacketsYieldIncreasingNumbers) {
  std::mt19937 random(2);
  for (int round = 0; round < 300; ++round) {
    StreamDecoder decoder(1 + static_cast<int>(random() % 16),
                          1 + static_cast<int>(random() % 512));
    std::uint64_t next = 0;
    std::uint16_t number = 0;
    for (int i = 0; i < 20; ++i) {
      std::vector<std::uint16_t> samples(random() % 600);
      for (std::uint16_t& sample : samples) {
        sample = random() % 8 == 0 ? none : static_cast<std::uint16_t>(random());
      }
      if (random() % 8 == 0) number = static_cast<std::uint16_t>(number + random() % 3);
      const std::uint16_t status =
          random() % 3 == 0 ? static_cast<std::uint16_t>(2939 + random() % 7) : std::uint16_t{0};
      static_cast<void>(decoder.take(
          packet(number++, samples, status, static_cast<std::uint16_t>(random())).packet));
      for (const Scan& scan : decoder.scans()) {
        ASSERT_GE(scan.index, next);
        next = scan.index + 1;
      }
    }
  }
}

}  // namespace
}  // namespace stickslip::drivers::labjack_t7
