// SPDX-License-Identifier: Apache-2.0
// Encoding of messages, with the examples of the Modbus specification.
#include "drivers/modbus/adu.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace stickslip::drivers::modbus {
namespace {

using config::RegisterTable;
using testing::ElementsAre;
using testing::IsEmpty;

const Bytes read_three = read_message(17, {RegisterTable::holding_registers, 0x6B, 3});

TEST(ModbusMessage, ReadsAreSixBytes) {
  EXPECT_THAT(read_three, ElementsAre(17, 3, 0, 0x6B, 0, 3));
  EXPECT_EQ(read_message(1, {RegisterTable::coils, 0, 1})[1], 1);
  EXPECT_EQ(read_message(1, {RegisterTable::discrete_inputs, 0, 1})[1], 2);
  EXPECT_EQ(read_message(1, {RegisterTable::input_registers, 0xFFFF, 1}),
            (Bytes{1, 4, 0xFF, 0xFF, 0, 1}));
}

TEST(ModbusMessage, WritesAreSingleOrMultiple) {
  const std::uint16_t words[] = {0x000A, 0x0102};
  const auto table = RegisterTable::holding_registers;
  EXPECT_EQ(write_message(1, table, 1, words, false), (Bytes{1, 16, 0, 1, 0, 2, 4, 0, 0x0A, 1, 2}));
  EXPECT_EQ(write_message(1, table, 1, std::span(words, 1), true), (Bytes{1, 6, 0, 1, 0, 0x0A}));
  EXPECT_EQ(write_message(1, table, 1, words, true)[1], 16) << "function 6 writes one register";
  const std::uint16_t on[] = {1};
  EXPECT_EQ(write_message(1, RegisterTable::coils, 3, on, true), (Bytes{1, 5, 0, 3, 0xFF, 0}));
  EXPECT_EQ(write_message(1, RegisterTable::coils, 3, on, false), (Bytes{1, 15, 0, 3, 0, 1, 1, 1}));
}

TEST(ModbusMessage, OnlyTheMatchingReplyIsAccepted) {
  const Reply good = match_reply(read_three, Bytes{17, 3, 6, 2, 0x2B, 0, 0, 0, 0x64});
  EXPECT_EQ(good.verdict, Verdict::answer);
  EXPECT_THAT(good.words, ElementsAre(0x022B, 0, 0x64));
  const auto verdict = [](const Bytes& reply) { return match_reply(read_three, reply).verdict; };
  EXPECT_EQ(verdict({18, 3, 6, 2, 0x2B, 0, 0, 0, 0x64}), Verdict::other_unit);
  EXPECT_EQ(verdict({0, 3, 6, 2, 0x2B, 0, 0, 0, 0x64}), Verdict::other_unit);
  EXPECT_EQ(verdict({17, 4, 6, 2, 0x2B, 0, 0, 0, 0x64}), Verdict::mismatch);
  EXPECT_EQ(verdict({17, 3, 4, 2, 0x2B, 0, 0}), Verdict::mismatch);
  EXPECT_EQ(verdict({17, 3, 6, 2, 0x2B, 0, 0}), Verdict::mismatch);
  EXPECT_EQ(verdict({17, 3, 6, 2, 0x2B, 0, 0, 0, 0x64, 0}), Verdict::mismatch);
  EXPECT_EQ(verdict({17, 3}), Verdict::mismatch);
  EXPECT_EQ(verdict({}), Verdict::mismatch);
}

TEST(ModbusMessage, ExceptionRepliesHaveACode) {
  const Reply refused = match_reply(read_three, Bytes{17, 0x83, 2});
  EXPECT_EQ(refused.verdict, Verdict::exception);
  EXPECT_EQ(refused.exception, 2);
  EXPECT_EQ(match_reply(read_three, Bytes{17, 0x84, 2}).verdict, Verdict::mismatch);
  EXPECT_EQ(match_reply(read_three, Bytes{17, 0x83, 2, 0}).verdict, Verdict::mismatch);
  for (const std::uint8_t code : Bytes{1, 2, 3, 4, 5, 6, 8, 10, 11}) {
    EXPECT_STRNE(name_of_exception(code), "unknown");
  }
}

TEST(ModbusMessage, BitsArePackedEightToAByteLowestFirst) {
  const Bytes request = read_message(1, {RegisterTable::coils, 0, 10});
  EXPECT_THAT(match_reply(request, Bytes{1, 1, 2, 0x05, 0x02}).words,
              ElementsAre(1, 0, 1, 0, 0, 0, 0, 0, 0, 1));
  EXPECT_EQ(match_reply(request, Bytes{1, 1, 1, 0x05}).verdict, Verdict::mismatch);
}

TEST(ModbusMessage, ReplyToAWriteEchoesAddressAndCount) {
  const std::uint16_t words[] = {1, 2};
  const Bytes many = write_message(1, RegisterTable::holding_registers, 7, words, false);
  EXPECT_EQ(match_reply(many, Bytes{1, 16, 0, 7, 0, 2}).verdict, Verdict::answer);
  EXPECT_EQ(match_reply(many, Bytes{1, 16, 0, 8, 0, 2}).verdict, Verdict::mismatch);
  EXPECT_EQ(match_reply(many, Bytes{1, 16, 0, 7, 0, 1}).verdict, Verdict::mismatch);
}

TEST(ModbusMessage, TcpHeaderHoldsTransactionAndLength) {
  const Bytes frame = with_tcp_header(0x1234, read_three);
  EXPECT_THAT(frame, ElementsAre(0x12, 0x34, 0, 0, 0, 6, 17, 3, 0, 0x6B, 0, 3));
  EXPECT_EQ(transaction_of(frame), 0x1234);
  for (std::size_t size = 0; size < frame.size(); ++size) {
    EXPECT_FALSE(transaction_of(std::span(frame).first(size)));
  }
  Bytes other_protocol = frame;
  other_protocol[3] = 1;
  EXPECT_FALSE(transaction_of(other_protocol));
  other_protocol[2] = 1;
  other_protocol[3] = 0;
  EXPECT_FALSE(transaction_of(other_protocol));
}

TEST(ModbusAdu, OnlyReadsOfOneFormAreConfusable) {
  const auto read = [](int unit, RegisterTable table, int address, int count) {
    return read_message(unit, {table, address, count});
  };
  using enum RegisterTable;
  const Bytes one = read(1, holding_registers, 0, 2);
  EXPECT_TRUE(confusable(one, read(1, holding_registers, 8, 2)));
  EXPECT_FALSE(confusable(one, one)) << "a late reply answers the repeated request";
  EXPECT_FALSE(confusable(one, read(1, holding_registers, 8, 1)));
  EXPECT_FALSE(confusable(one, read(1, input_registers, 8, 2)));
  EXPECT_FALSE(confusable(one, read(2, holding_registers, 8, 2)));
  EXPECT_TRUE(confusable(read(1, coils, 0, 3), read(1, coils, 0, 8))) << "one byte each";
  const std::uint16_t word[] = {7};
  EXPECT_FALSE(confusable(write_message(1, holding_registers, 0, word, true),
                          write_message(1, holding_registers, 1, word, true)));
}

}  // namespace
}  // namespace stickslip::drivers::modbus
