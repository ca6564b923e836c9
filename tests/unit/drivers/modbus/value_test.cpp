// SPDX-License-Identifier: Apache-2.0
// Conversion between words and values.
#include "drivers/modbus/value.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace stickslip::drivers::modbus {
namespace {

using config::ByteOrder;
using config::ModbusRegister;
using config::RegisterType;
using enum config::RegisterType;

constexpr ByteOrder orders[] = {ByteOrder::abcd, ByteOrder::cdab, ByteOrder::badc, ByteOrder::dcba};
constexpr RegisterType types[] = {bit,   uint16,  int16,   uint32, int32,
                                  int64, float32, float64, bcd16,  bcd32};

ModbusRegister plain(RegisterType type, ByteOrder order = ByteOrder::abcd) {
  ModbusRegister reg;
  reg.type = type;
  reg.order = order;
  return reg;
}

std::optional<double> value(const ModbusRegister& reg, std::vector<std::uint16_t> words) {
  return value_of(reg, words);
}

TEST(ModbusValue, FloatsAreReadInFourByteOrders) {
  // 3.25 is 40 50 00 00; 1.2345679 is 3F 9E 06 52.
  EXPECT_EQ(value(plain(float32, ByteOrder::abcd), {0x4050, 0x0000}), 3.25);
  EXPECT_EQ(value(plain(float32, ByteOrder::cdab), {0x0000, 0x4050}), 3.25);
  EXPECT_EQ(value(plain(float32, ByteOrder::badc), {0x5040, 0x0000}), 3.25);
  EXPECT_EQ(value(plain(float32, ByteOrder::dcba), {0x0000, 0x5040}), 3.25);
  const double odd = static_cast<double>(1.2345679F);
  EXPECT_EQ(value(plain(float32, ByteOrder::abcd), {0x3F9E, 0x0652}), odd);
  EXPECT_EQ(value(plain(float32, ByteOrder::cdab), {0x0652, 0x3F9E}), odd);
  EXPECT_EQ(value(plain(float32, ByteOrder::badc), {0x9E3F, 0x5206}), odd);
  EXPECT_EQ(value(plain(float32, ByteOrder::dcba), {0x5206, 0x9E3F}), odd);
}

TEST(ModbusValue, FourRegistersFollowTheirByteOrder) {
  EXPECT_EQ(value(plain(int64, ByteOrder::abcd), {0, 1, 0, 0}), 4294967296.0);
  EXPECT_EQ(value(plain(int64, ByteOrder::cdab), {0, 0, 1, 0}), 4294967296.0);
  EXPECT_EQ(value(plain(int64, ByteOrder::badc), {0, 0x0100, 0, 0}), 4294967296.0);
  EXPECT_EQ(value(plain(int64, ByteOrder::dcba), {0, 0, 0x0100, 0}), 4294967296.0);
  EXPECT_EQ(value(plain(float64), {0x400A, 0, 0, 0}), 3.25);
}

TEST(ModbusValue, IntegersAreSignedOrUnsigned) {
  EXPECT_EQ(value(plain(uint16), {0xFFFF}), 65535.0);
  EXPECT_EQ(value(plain(int16), {0xFFFF}), -1.0);
  EXPECT_EQ(value(plain(uint32), {0xFFFF, 0xFFFE}), 4294967294.0);
  EXPECT_EQ(value(plain(int32), {0xFFFF, 0xFFFE}), -2.0);
  EXPECT_EQ(value(plain(int64), {0xFFFF, 0xFFFF, 0xFFFF, 0xFFFD}), -3.0);
}

TEST(ModbusValue, BcdIsCheckedDigitByDigit) {
  EXPECT_EQ(value(plain(bcd16), {0x1234}), 1234.0);
  EXPECT_EQ(value(plain(bcd32), {0x0012, 0x3456}), 123456.0);
  EXPECT_EQ(value(plain(bcd32, ByteOrder::cdab), {0x3456, 0x0012}), 123456.0);
  for (const std::uint16_t word : std::vector<std::uint16_t>{0xA000, 0x0B00, 0x00C0, 0x000D}) {
    EXPECT_FALSE(value(plain(bcd16), {word})) << word;
    EXPECT_FALSE(value(plain(bcd32), {word, 0})) << word;
  }
}

TEST(ModbusValue, InvalidEncodingsHaveNoValue) {
  EXPECT_FALSE(value(plain(float32), {0x7FC0, 0x0000}));
  EXPECT_FALSE(value(plain(float32), {0x7F80, 0x0000}));
  EXPECT_FALSE(value(plain(float64), {0xFFF0, 0, 0, 0}));
  EXPECT_FALSE(value(plain(bit), {2}));
  EXPECT_FALSE(value(plain(float32), {0x4050}));
  EXPECT_FALSE(value(plain(uint16), {}));
  EXPECT_FALSE(raw_of(plain(uint16), std::vector<std::uint16_t>{1, 2}));
}

TEST(ModbusValue, ScaleAndOffsetApplyToTheValueOnly) {
  ModbusRegister reg = plain(int16);
  reg.scale = 0.01;
  reg.offset = -5.0;
  EXPECT_DOUBLE_EQ(*value(reg, {250}), -2.5);
  EXPECT_EQ(raw_of(reg, std::vector<std::uint16_t>{250}), 250);
  EXPECT_EQ(words_for(reg, -2.5)->word[0], 250);
  reg.scale = 0.0;
  EXPECT_FALSE(words_for(reg, 1.0));
}

TEST(ModbusValue, StatusMayBeAFloatWithAnIntegralValue) {
  EXPECT_EQ(raw_of(plain(float32), std::vector<std::uint16_t>{0x4040, 0}), 3);
  EXPECT_FALSE(raw_of(plain(float32), std::vector<std::uint16_t>{0x4050, 0}));
  EXPECT_FALSE(raw_of(plain(float64), std::vector<std::uint16_t>{0x7FE0, 0, 0, 0}));
}

TEST(ModbusValue, StatusIsComparedInTheBitsOfItsMask) {
  ModbusRegister reg = plain(uint16);
  reg.mask = 6;
  EXPECT_EQ(raw_of(reg, std::vector<std::uint16_t>{0xFFF9}), 0);
  EXPECT_EQ(raw_of(reg, std::vector<std::uint16_t>{0x001A}), 2);
  reg.type = int16;
  EXPECT_EQ(raw_of(reg, std::vector<std::uint16_t>{0xFFFF}), 6);
  reg.type = float32;
  EXPECT_EQ(raw_of(reg, std::vector<std::uint16_t>{0x40A0, 0}), 4) << "5 as a float";
  EXPECT_EQ(value(reg, {0x40A0, 0}), 5.0) << "the value keeps all bits";
}

TEST(ModbusValue, OutOfRangeValuesAreNotWritten) {
  const struct {
    RegisterType type;
    double low;
    double high;
  } limits[] = {{bit, 0, 1},
                {uint16, 0, 65535},
                {int16, -32768, 32767},
                {uint32, 0, 4294967295.0},
                {int32, -2147483648.0, 2147483647.0},
                {bcd16, 0, 9999},
                {bcd32, 0, 99999999}};
  for (const auto& limit : limits) {
    EXPECT_TRUE(words_for(plain(limit.type), limit.low));
    EXPECT_TRUE(words_for(plain(limit.type), limit.high));
    EXPECT_FALSE(words_for(plain(limit.type), limit.low - 1));
    EXPECT_FALSE(words_for(plain(limit.type), limit.high + 1));
  }
  EXPECT_FALSE(words_for(plain(int64), 0x1p63));
  EXPECT_TRUE(words_for(plain(int64), -0x1p63));
  EXPECT_FALSE(words_for(plain(float32), 1e39));
  for (const RegisterType type : types) {
    EXPECT_FALSE(words_for(plain(type), std::numeric_limits<double>::quiet_NaN()));
    EXPECT_FALSE(words_for(plain(type), std::numeric_limits<double>::infinity()));
  }
}

/// A number representable by a type.
double some_number(RegisterType type) {
  switch (type) {
    case bit:
      return *rc::gen::inRange(0, 2);
    case uint16:
      return *rc::gen::arbitrary<std::uint16_t>();
    case int16:
      return *rc::gen::arbitrary<std::int16_t>();
    case uint32:
      return *rc::gen::arbitrary<std::uint32_t>();
    case int32:
      return *rc::gen::arbitrary<std::int32_t>();
    case int64:  // limited to exact doubles
      return static_cast<double>(*rc::gen::inRange<std::int64_t>(-(1LL << 53), 1LL << 53));
    case float32:
      return static_cast<double>(*rc::gen::arbitrary<float>());
    case float64:
      return *rc::gen::arbitrary<double>();
    case bcd16:
      return *rc::gen::inRange(0, 10000);
    case bcd32:
      break;
  }
  return *rc::gen::inRange(0, 100000000);
}

RC_GTEST_PROP(ModbusValue, WrittenValuesReadBackInEveryTypeAndOrder, ()) {
  for (const RegisterType type : types) {
    const double number = some_number(type);
    RC_PRE(std::isfinite(number));
    for (const ByteOrder order : orders) {
      const ModbusRegister reg = plain(type, order);
      const auto words = words_for(reg, number);
      RC_ASSERT(words.has_value());
      RC_ASSERT(words->count == registers_of(type));
      RC_ASSERT(value_of(reg, words->view()) == number);
    }
  }
}

RC_GTEST_PROP(ModbusValue, ReadValuesAreWrittenIdentically, (std::vector<std::uint16_t> words)) {
  words.resize(4, 0);
  for (const RegisterType type : types) {
    if (type == int64) continue;  // not exactly representable as double
    for (const ByteOrder order : orders) {
      const ModbusRegister reg = plain(type, order);
      const auto used = std::span(words).first(registers_of(type));
      const auto number = value_of(reg, used);
      if (!number) continue;
      const auto again = words_for(reg, *number);
      RC_ASSERT(again.has_value());
      // Compares values, not words: -0.0 may become 0.0.
      RC_ASSERT(value_of(reg, again->view()) == number);
    }
  }
}

}  // namespace
}  // namespace stickslip::drivers::modbus
