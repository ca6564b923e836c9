// SPDX-License-Identifier: Apache-2.0
// Conversion between register words and values. Independent of the library's conversion of floats,
// which differs between releases and is inconsistent in some.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "config/modbus_map.h"

namespace stickslip::drivers::modbus {

/// The words of one value in order of transmission. A bit is one word, 0 or 1.
struct Words {
  std::array<std::uint16_t, 4> word{};
  std::size_t count = 0;

  std::span<const std::uint16_t> view() const { return {word.data(), count}; }
  friend bool operator==(const Words&, const Words&) = default;
};

/// raw * scale + offset. None for an invalid encoding: wrong number of words, a float that is not
/// finite, a BCD digit beyond 9.
std::optional<double> value_of(const config::ModbusRegister& reg,
                               std::span<const std::uint16_t> words);

/// The number before scale and offset, of which only the bits of `mask` if there is one, to be
/// compared with `ok`. None if value_of has none, or for a float that is not an integer.
std::optional<std::int64_t> raw_of(const config::ModbusRegister& reg,
                                   std::span<const std::uint16_t> words);

/// Words that set the register to `value`: (value - offset) / scale, rounded for integer types.
/// None if out of range.
std::optional<Words> words_for(const config::ModbusRegister& reg, double value);

}  // namespace stickslip::drivers::modbus
