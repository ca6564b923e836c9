// SPDX-License-Identifier: Apache-2.0
// Register memory of an emulated LabJack T7, by the vendor's register map: words of 16 bits, larger
// values in consecutive ones, the high word first.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <map>

namespace stickslip::emulated {

class T7Registers {
 public:
  T7Registers();

  bool has(int address) const { return words_.contains(address); }
  std::uint16_t word(int address) const;
  std::uint32_t number(int address) const;
  float real(int address) const { return std::bit_cast<float>(number(address)); }
  void set_word(int address, std::uint16_t value) { words_[address] = value; }
  void set_number(int address, std::uint32_t value);
  void set_real(int address, float value) {
    set_number(address, std::bit_cast<std::uint32_t>(value));
  }

 private:
  std::map<int, std::uint16_t> words_;
};

/// Constants of the high-speed converter by gain, as in the flash: slopes for positive and negative
/// voltages, center, offset.
struct T7Constants {
  std::array<std::array<float, 4>, 4> gain{};
  /// Near the nominal ones, different for each seed.
  static T7Constants of(std::uint64_t seed);
  /// The reading of a voltage at that range (0: 10 V to 3: 0.01 V); never FFFF.
  std::uint16_t counts(int range, double volts) const;
};

}  // namespace stickslip::emulated
