// The numbers in a unit's registers: words as they travel to values and back. Own packing: the
// library's for floats differs between its releases, and in some its two directions do not agree.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "config/modbus_map.h"

namespace stickslip::drivers::modbus {

/// The words of one value, in the order in which they travel. A bit is one word, 0 or 1.
struct Words {
  std::array<std::uint16_t, 4> word{};
  std::size_t count = 0;

  std::span<const std::uint16_t> view() const { return {word.data(), count}; }
  friend bool operator==(const Words&, const Words&) = default;
};

/// raw * scale + offset. Nothing where the words are no value: not as many as the type takes, a
/// float that is not finite, a BCD digit beyond 9.
std::optional<double> value_of(const config::ModbusRegister& its,
                               std::span<const std::uint16_t> words);

/// The number as it stands in the unit, before scale and offset: what `ok` is compared with.
/// Nothing where value_of has nothing, or where a float is not whole.
std::optional<std::int64_t> raw_of(const config::ModbusRegister& its,
                                   std::span<const std::uint16_t> words);

/// What has to be written so that the register holds `value`: (value - offset) / scale, to the
/// nearest whole number for the types that hold whole numbers. Nothing where it does not fit.
std::optional<Words> words_for(const config::ModbusRegister& its, double value);

}  // namespace stickslip::drivers::modbus
