// SPDX-License-Identifier: Apache-2.0
#include "tools/telemetry/lcm_packets.h"

#include <gtest/gtest.h>

namespace stickslip::telemetry {
namespace {

using Bytes = std::vector<std::uint8_t>;
const std::string a = "10.0.0.1:40000";
const std::string b = "10.0.0.1:40001";

void put(Bytes& out, std::uint32_t value, int size) {
  for (int i = size - 1; i >= 0; --i) out.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

void put_text(Bytes& out, std::string_view text) {
  out.insert(out.end(), text.begin(), text.end());
}

Bytes short_packet(std::string_view text) {
  Bytes out;
  put(out, 0x4C433032, 4);
  put(out, 7, 4);
  put_text(out, text);
  return out;
}

struct Place {
  std::uint32_t number, size, offset, index, count;
};

Bytes fragment(Place at, std::string_view text) {
  Bytes out;
  put(out, 0x4C433033, 4);
  for (const std::uint32_t word : {at.number, at.size, at.offset}) put(out, word, 4);
  for (const std::uint32_t half : {at.index, at.count}) put(out, half, 2);
  put_text(out, text);
  return out;
}

std::string text_of(const std::optional<LcmMessage>& message) {
  if (!message) return "";
  return message->sender + " " + message->channel + " " +
         std::string(message->bytes.begin(), message->bytes.end());
}

using namespace std::string_view_literals;

TEST(PacketAssembler, AMessageOfOnePacketHasItsSender) {
  PacketAssembler assembler;
  EXPECT_EQ(text_of(assembler.take(short_packet("NAME\0data"sv), a)), a + " NAME data");
  EXPECT_EQ(text_of(assembler.take(short_packet("NAME\0"sv), b)), b + " NAME ");
  EXPECT_EQ(assembler.malformed(), 0U);
}

TEST(PacketAssembler, FragmentsOfTwoSendersAreNotMixed) {
  PacketAssembler assembler;
  EXPECT_FALSE(assembler.take(fragment({1, 6, 0, 0, 2}, "ONE\0abc"sv), a));
  EXPECT_FALSE(assembler.take(fragment({1, 6, 0, 0, 2}, "TWO\0ABC"sv), b));
  EXPECT_EQ(text_of(assembler.take(fragment({1, 6, 3, 1, 2}, "DEF"), b)), b + " TWO ABCDEF");
  EXPECT_EQ(text_of(assembler.take(fragment({1, 6, 3, 1, 2}, "def"), a)), a + " ONE abcdef");
}

TEST(PacketAssembler, ALostFragmentLosesItsMessageOnly) {
  PacketAssembler assembler;
  EXPECT_FALSE(assembler.take(fragment({1, 6, 0, 0, 2}, "ONE\0abc"sv), a));
  EXPECT_FALSE(assembler.take(fragment({2, 4, 2, 1, 2}, "yz"), a));
  EXPECT_EQ(text_of(assembler.take(fragment({2, 4, 0, 0, 2}, "ONE\0wx"sv), a)), a + " ONE wxyz");
}

TEST(PacketAssembler, MalformedPacketsAreCountedAndHarmless) {
  PacketAssembler assembler;
  const std::vector<Bytes> packets = {
      {},
      Bytes(7, 0xFF),
      Bytes(100, 0xFF),
      short_packet("name without an end"),
      fragment({1, 6, 0, 0, 2}, "no end"),
      fragment({1, 6, 5, 1, 2}, "beyond"),
      fragment({1, 6, 0xFFFFFFFF, 1, 2}, "far beyond"),
      fragment({1, 0xFFFFFFFF, 0, 1, 2}, "huge"),
      fragment({1, 6, 0, 2, 2}, "third of two"),
      fragment({1, 6, 0, 0, 0}, "X\0abc"sv),
  };
  for (const Bytes& packet : packets) EXPECT_FALSE(assembler.take(packet, a));
  EXPECT_EQ(assembler.malformed(), packets.size());
  for (std::uint32_t i = 0; i < 200; ++i) {
    assembler.take(fragment({1, 6, 0, 0, 2}, "X\0abc"sv), "10.0.0.2:" + std::to_string(i));
  }
  EXPECT_EQ(assembler.malformed(), packets.size() + 200 - PacketAssembler::max_senders);
}

}  // namespace
}  // namespace stickslip::telemetry
