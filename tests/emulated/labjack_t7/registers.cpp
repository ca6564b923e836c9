// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/labjack_t7/registers.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace stickslip::emulated {

T7Registers::T7Registers() {
  const auto numbers = [this](int first, int last) {
    for (int address = first; address <= last; address += 2) set_number(address, 0);
  };
  numbers(1000, 1002);                                            // DAC0, DAC1
  for (int line = 0; line < 23; ++line) words_[2000 + line] = 0;  // DIO#
  numbers(2800, 2800);                                            // DIO_STATE
  numbers(4002, 4024);                                            // STREAM_...
  numbers(4100, 4100 + 2 * 127);                                  // STREAM_SCANLIST_ADDRESS#
  numbers(4990, 4990);                                            // STREAM_ENABLE
  for (int input = 0; input < 14; ++input) set_real(40000 + 2 * input, 10.0F);  // AIN#_RANGE
  for (int input = 0; input < 14; ++input) words_[41000 + input] = 199;         // ..._NEGATIVE_CH
  words_[55000] = 0;                                                            // LAST_ERR_DETAIL
  numbers(60000, 60004);
  numbers(60028, 60028);
  for (int address : {61600, 61602, 61604, 61606, 61610, 61612, 61614, 61620, 61630, 61632, 61634,
                      61636, 61640, 61642, 61650, 61652}) {
    set_number(address, 0);  // WATCHDOG_...
  }
  numbers(61810, 61812);  // INTERNAL_FLASH_READ_POINTER, INTERNAL_FLASH_READ
}

std::uint16_t T7Registers::word(int address) const {
  const auto found = words_.find(address);
  return found == words_.end() ? std::uint16_t{0} : found->second;
}

std::uint32_t T7Registers::number(int address) const {
  return std::uint32_t{word(address)} * 65536U + word(address + 1);
}

void T7Registers::set_number(int address, std::uint32_t value) {
  words_[address] = static_cast<std::uint16_t>(value / 65536U);
  words_[address + 1] = static_cast<std::uint16_t>(value % 65536U);
}

T7Constants T7Constants::of(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> spread(-1.0, 1.0);
  T7Constants out;
  double scale = 1.0;
  for (auto& constants : out.gain) {
    const double center = 33523.0 + 300.0 * spread(random);
    constants = {static_cast<float>(315.805780e-6 * scale * (1.0 + 0.004 * spread(random))),
                 static_cast<float>(-315.805800e-6 * scale * (1.0 + 0.004 * spread(random))),
                 static_cast<float>(center), static_cast<float>(-10.586956522 * scale)};
    scale /= 10.0;
  }
  return out;
}

std::uint16_t T7Constants::counts(int range, double volts) const {
  const auto& constants = gain[static_cast<std::size_t>(range)];
  const double per_volt = volts < 0.0 ? -1.0 / static_cast<double>(constants[1])
                                      : 1.0 / static_cast<double>(constants[0]);
  const double counts = std::round(static_cast<double>(constants[2]) + volts * per_volt);
  return static_cast<std::uint16_t>(std::clamp(counts, 0.0, 65534.0));
}

}  // namespace stickslip::emulated
