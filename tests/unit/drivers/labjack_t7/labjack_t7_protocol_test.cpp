// SPDX-License-Identifier: Apache-2.0
// Encoding and decoding for the LabJack T7, byte by byte.
#include "drivers/labjack_t7/protocol.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <vector>

namespace stickslip::drivers::labjack_t7 {
namespace {

using Bytes = std::vector<std::uint8_t>;
using testing::ElementsAre;
using testing::HasSubstr;

Bytes bytes_of(const Feedback& request) { return {request.bytes().begin(), request.bytes().end()}; }

TEST(LabjackT7Protocol, RequestHoldsWritesAndReadsInOrder) {
  Feedback request(0x1234);
  request.write_float(dac0, 2.5F).write_word(dio0 + 3, 1).read(dio_state, 2);
  EXPECT_THAT(bytes_of(request), ElementsAre(0x12, 0x34, 0, 0, 0, 20, 1, 76,      // header
                                             1, 0x03, 0xE8, 2, 0x40, 0x20, 0, 0,  // DAC0 = 2.5
                                             1, 0x07, 0xD3, 1, 0, 1,              // DIO3 = 1
                                             0, 0x0A, 0xF0, 2));                  // DIO_STATE
  EXPECT_EQ(request.reply_bytes(), 4U);
}

TEST(LabjackT7Protocol, RequestDoesNotExceedTheLimitOfTheBoard) {
  Feedback request(1);
  for (int i = 0; i < 400; ++i) request.write(stream_list0, 0);
  EXPECT_LE(request.bytes().size(), largest_message);
}

/// A reply to transaction 7 with that function and data.
Bytes reply(std::uint8_t function, const Bytes& data) {
  Bytes out{0, 7, 0, 0, 0, static_cast<std::uint8_t>(2 + data.size()), 1, function};
  out.insert(out.end(), data.begin(), data.end());
  return out;
}

TEST(LabjackT7Protocol, ReplyHoldsTheValuesThatWereRead) {
  std::span<const std::uint8_t> data;
  const Bytes message = reply(76, {0x40, 0xE0, 0, 0, 0x12, 0x34});
  ASSERT_TRUE(parse_reply(message, 6, data));
  EXPECT_EQ(transaction_of(message), 7);
  EXPECT_EQ(float_at(data, 0), 7.0F);
  EXPECT_EQ(word_at(data, 4), 0x1234);
}

TEST(LabjackT7Protocol, ReplyOfAnotherLengthOrFunctionIsNoReply) {
  std::span<const std::uint8_t> data;
  EXPECT_EQ(parse_reply(reply(76, {1, 2}), 4, data).kind, Verdict::Kind::garbled);
  EXPECT_EQ(parse_reply(reply(3, {1, 2}), 2, data).kind, Verdict::Kind::garbled);
  EXPECT_EQ(parse_reply(reply(76 | 0x80, {}), 2, data).kind, Verdict::Kind::garbled);
}

TEST(LabjackT7Protocol, ExceptionIsNamed) {
  std::span<const std::uint8_t> data;
  Verdict verdict = parse_reply(reply(76 | 0x80, {2}), 4, data);
  EXPECT_EQ(verdict.kind, Verdict::Kind::exception);
  EXPECT_EQ(in_words(verdict), "Modbus exception 2 (illegal address)");
  verdict.error = 2608;
  EXPECT_EQ(in_words(verdict), "error 2608 (too many samples per second)");
  EXPECT_EQ(unpacked(packed(verdict)).error, 2608);
  EXPECT_EQ(unpacked(packed(verdict)).kind, Verdict::Kind::exception);
}

/// Feeds bytes in pieces of that size; the messages found, and if the reader gave up.
std::vector<Bytes> read_in_pieces(const Bytes& bytes, std::size_t piece, bool& garbled) {
  MessageReader reader;
  std::vector<Bytes> out;
  garbled = false;
  for (std::size_t at = 0; at < bytes.size() && !garbled;) {
    const std::span<std::uint8_t> space = reader.space();
    const std::size_t size = std::min({piece, bytes.size() - at, space.size()});
    if (size == 0) return out;
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), size, space.begin());
    reader.received(size);
    at += size;
    std::span<const std::uint8_t> message;
    for (;;) {
      const MessageReader::Next next = reader.next(message);
      garbled = next == MessageReader::Next::garbled;
      if (next != MessageReader::Next::message) break;
      out.emplace_back(message.begin(), message.end());
    }
  }
  return out;
}

TEST(LabjackT7Protocol, MessagesAreFoundHoweverTheNetworkCutsThem) {
  Bytes all;
  std::vector<Bytes> messages;
  for (std::size_t size : {0U, 5U, 200U, 3U}) {  // 0: the reply to writes
    messages.push_back(reply(76, Bytes(size, static_cast<std::uint8_t>(size))));
    all.insert(all.end(), messages.back().begin(), messages.back().end());
  }
  for (const std::size_t piece : {1U, 2U, 7U, 64U, 1000U}) {
    bool garbled = false;
    EXPECT_EQ(read_in_pieces(all, piece, garbled), messages) << piece;
    EXPECT_FALSE(garbled);
  }
}

TEST(LabjackT7Protocol, MessageWithAnImpossibleHeaderEndsTheReading) {
  bool garbled = false;
  EXPECT_TRUE(read_in_pieces({0, 1, 9, 9, 0, 4, 1, 76, 0, 0}, 100, garbled).empty());
  EXPECT_TRUE(garbled);
  EXPECT_TRUE(read_in_pieces({0, 1, 0, 0, 0xFF, 0xFF, 1, 76}, 100, garbled).empty());
  EXPECT_TRUE(garbled);
}

// Whatever arrives: no access beyond the bytes, and every result within its limits.
TEST(LabjackT7Protocol, AnyBytesAreRejectedOrPlausible) {
  std::mt19937 random(1);
  for (int round = 0; round < 20000; ++round) {
    Bytes bytes(random() % 80);
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
    if (round % 2 == 0 && bytes.size() > 8) {  // nearly a message
      bytes[2] = bytes[3] = bytes[4] = 0;
      bytes[5] = static_cast<std::uint8_t>(bytes.size() - 6 - random() % 2);
      bytes[7] = random() % 4 == 0 ? 0xCC : 76;
      bytes[8] = 16;
    }
    bool garbled = false;
    for (const Bytes& message : read_in_pieces(bytes, 1 + random() % 40, garbled)) {
      ASSERT_LE(message.size(), bytes.size());
      std::span<const std::uint8_t> data;
      if (parse_reply(message, message.size() - 8, data)) {
        ASSERT_EQ(data.size(), message.size() - 8);
      }
      if (const auto packet = parse_packet(message)) {
        ASSERT_EQ(packet->samples.size(), message.size() - 16);
      }
    }
  }
}

TEST(LabjackT7Protocol, IdentityIsRead) {
  EXPECT_EQ(request_identity(1).reply_bytes(), 12U);
  const Bytes data{0x40, 0xE0, 0, 0, 0x3F, 0x83, 0xCD, 0x36, 0x1C, 0x05, 0x65, 0xA9};
  const Identity identity = identity_of(data);
  EXPECT_EQ(identity.product, 7.0F);
  EXPECT_EQ(identity.serial, 0x1C0565A9U);
  EXPECT_EQ(firmware_of(identity), "1.0297");
}

TEST(LabjackT7Protocol, CalibrationIsReadFromTheFlash) {
  EXPECT_THAT(bytes_of(request_calibration(1, 1)),
              ElementsAre(0, 1, 0, 0, 0, 14, 1, 76, 1, 0xF1, 0x72, 2, 0x00, 0x3C, 0x40, 0x20, 0,
                          0xF1, 0x74, 16));
  Bytes data;
  for (const float value : {1.0F, -2.0F, 3.0F, 4.0F, 5.0F, -6.0F, 7.0F, 8.0F}) {
    Feedback encoder(0);
    encoder.write_float(0, value);
    data.insert(data.end(), encoder.bytes().end() - 4, encoder.bytes().end());
  }
  labjack::ConverterCalibration calibration;
  add_constants(calibration, 1, data);
  EXPECT_EQ(calibration.positive_slope_v[2], 1.0);
  EXPECT_EQ(calibration.negative_slope_v[2], -2.0);
  EXPECT_EQ(calibration.center[2], 3.0);
  EXPECT_EQ(calibration.positive_slope_v[3], 5.0);
  EXPECT_EQ(calibration.center[3], 7.0);
  EXPECT_EQ(calibration.center[0], 0.0);
}

TEST(LabjackT7Protocol, IntervalsAreThoseOfTheBoardsClock) {
  EXPECT_EQ(interval_ns(1000.0), 1'000'000);
  EXPECT_EQ(interval_ns(100000.0), 10'000);
  EXPECT_EQ(interval_ns(300.0), 3'333'300);  // steps of 100 ns
  EXPECT_EQ(interval_ns(60.0), 16'667'000);  // of 1 us
  EXPECT_EQ(interval_ns(1.0), 1'000'000'000);
  EXPECT_EQ(interval_ns(0.0), 0);
  EXPECT_EQ(interval_ns(-1.0), 0);
  EXPECT_EQ(interval_ns(std::numeric_limits<double>::quiet_NaN()), 0);
  EXPECT_EQ(interval_ns(1e9), 0);
}

}  // namespace
}  // namespace stickslip::drivers::labjack_t7
