// SPDX-License-Identifier: Apache-2.0
#include "drivers/modbus/value.h"

#include <bit>
#include <cmath>
#include <limits>

namespace stickslip::drivers::modbus {

namespace {

using config::ByteOrder;
using config::ModbusRegister;
using config::RegisterType;

std::uint16_t bytes_swapped(std::uint16_t word) {
  return static_cast<std::uint16_t>((word << 8U) | (word >> 8U));
}

bool swaps_words(ByteOrder order) { return order == ByteOrder::cdab || order == ByteOrder::dcba; }

bool swaps_bytes(ByteOrder order) { return order == ByteOrder::badc || order == ByteOrder::dcba; }

std::uint64_t bits_of(std::span<const std::uint16_t> words, ByteOrder order) {
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::uint16_t word = words[swaps_words(order) ? words.size() - 1 - i : i];
    bits = (bits << 16U) | (swaps_bytes(order) ? bytes_swapped(word) : word);
  }
  return bits;
}

Words words_of_bits(std::uint64_t bits, std::size_t count, ByteOrder order) {
  Words words;
  words.count = count;
  for (std::size_t i = 0; i < count; ++i) {
    const auto word = static_cast<std::uint16_t>(bits >> (16 * (count - 1 - i)));
    words.word[swaps_words(order) ? count - 1 - i : i] =
        swaps_bytes(order) ? bytes_swapped(word) : word;
  }
  return words;
}

int bcd_digits(RegisterType type) { return type == RegisterType::bcd16 ? 4 : 8; }

std::optional<std::int64_t> from_bcd(std::uint64_t bits, int digits) {
  std::int64_t number = 0;
  for (int i = digits - 1; i >= 0; --i) {
    const std::uint64_t digit = (bits >> (4 * i)) & 0xFU;
    if (digit > 9) return std::nullopt;
    number = 10 * number + static_cast<std::int64_t>(digit);
  }
  return number;
}

std::uint64_t to_bcd(std::int64_t number, int digits) {
  std::uint64_t bits = 0;
  for (int i = 0; i < digits; ++i, number /= 10) {
    bits |= static_cast<std::uint64_t>(number % 10) << (4 * i);
  }
  return bits;
}

/// For integer types.
std::optional<std::int64_t> integer_of(RegisterType type, std::uint64_t bits) {
  switch (type) {
    case RegisterType::bit:
      return bits <= 1 ? std::optional(static_cast<std::int64_t>(bits)) : std::nullopt;
    case RegisterType::int16:
      return static_cast<std::int16_t>(bits);
    case RegisterType::int32:
      return static_cast<std::int32_t>(bits);
    case RegisterType::bcd16:
    case RegisterType::bcd32:
      return from_bcd(bits, bcd_digits(type));
    case RegisterType::uint16:
    case RegisterType::uint32:
    case RegisterType::int64:
    case RegisterType::float32:
    case RegisterType::float64:
      break;
  }
  return static_cast<std::int64_t>(bits);
}

bool is_float(RegisterType type) {
  return type == RegisterType::float32 || type == RegisterType::float64;
}

double float_of(RegisterType type, std::uint64_t bits) {
  if (type == RegisterType::float64) return std::bit_cast<double>(bits);
  return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
}

/// Limits of an integer type as doubles; the maximum of int64 is not representable.
struct Range {
  double low;
  double high;
};

Range range_of(RegisterType type) {
  switch (type) {
    case RegisterType::bit:
      return {0.0, 1.0};
    case RegisterType::uint16:
      return {0.0, 65535.0};
    case RegisterType::int16:
      return {-32768.0, 32767.0};
    case RegisterType::uint32:
      return {0.0, 4294967295.0};
    case RegisterType::int32:
      return {-2147483648.0, 2147483647.0};
    case RegisterType::bcd16:
      return {0.0, 9999.0};
    case RegisterType::bcd32:
      return {0.0, 99999999.0};
    case RegisterType::int64:
    case RegisterType::float32:
    case RegisterType::float64:
      break;
  }
  return {-0x1p63, std::nextafter(0x1p63, 0.0)};
}

std::optional<std::uint64_t> bits_for(RegisterType type, double raw) {
  if (!std::isfinite(raw)) return std::nullopt;
  if (type == RegisterType::float64) return std::bit_cast<std::uint64_t>(raw);
  if (type == RegisterType::float32) {
    if (std::abs(raw) > static_cast<double>(std::numeric_limits<float>::max())) return std::nullopt;
    return std::bit_cast<std::uint32_t>(static_cast<float>(raw));
  }
  const double whole = std::round(raw);
  const Range range = range_of(type);
  if (whole < range.low || whole > range.high) return std::nullopt;
  const auto number = static_cast<std::int64_t>(whole);
  if (type == RegisterType::bcd16 || type == RegisterType::bcd32) {
    return to_bcd(number, bcd_digits(type));
  }
  return static_cast<std::uint64_t>(number);
}

}  // namespace

std::optional<double> value_of(const ModbusRegister& reg, std::span<const std::uint16_t> words) {
  if (words.size() != registers_of(reg.type)) return std::nullopt;
  // A coil has one bit and no byte order.
  const ByteOrder order = reg.type == RegisterType::bit ? ByteOrder::abcd : reg.order;
  const std::uint64_t bits = bits_of(words, order);
  double raw = 0.0;
  if (is_float(reg.type)) {
    raw = float_of(reg.type, bits);
  } else {
    const auto number = integer_of(reg.type, bits);
    if (!number) return std::nullopt;
    raw = static_cast<double>(*number);
  }
  const double value = raw * reg.scale + reg.offset;
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

std::optional<std::int64_t> raw_of(const ModbusRegister& reg,
                                   std::span<const std::uint16_t> words) {
  if (words.size() != registers_of(reg.type)) return std::nullopt;
  const ByteOrder order = reg.type == RegisterType::bit ? ByteOrder::abcd : reg.order;
  const std::uint64_t bits = bits_of(words, order);
  const std::int64_t mask = reg.mask.value_or(-1);
  if (!is_float(reg.type)) {
    const auto number = integer_of(reg.type, bits);
    return number ? std::optional(*number & mask) : std::nullopt;
  }
  const double raw = float_of(reg.type, bits);
  const Range range = range_of(RegisterType::int64);
  if (!std::isfinite(raw) || raw != std::round(raw) || raw < range.low || raw > range.high) {
    return std::nullopt;
  }
  return static_cast<std::int64_t>(raw) & mask;
}

std::optional<Words> words_for(const ModbusRegister& reg, double value) {
  const auto bits = bits_for(reg.type, (value - reg.offset) / reg.scale);
  if (!bits) return std::nullopt;
  const ByteOrder order = reg.type == RegisterType::bit ? ByteOrder::abcd : reg.order;
  return words_of_bits(*bits, registers_of(reg.type), order);
}

}  // namespace stickslip::drivers::modbus
