// SPDX-License-Identifier: Apache-2.0
// Bytes and checksums of the U6, as this emulation writes them.
#pragma once

#include <cstdint>
#include <span>

#include "tests/emulated/usb_device.h"

namespace stickslip::emulated::u6 {

/// The sum of all bytes, folded twice into eight bits.
inline std::uint8_t checksum8(std::span<const std::uint8_t> bytes) {
  unsigned sum = 0;
  for (const std::uint8_t byte : bytes) sum += byte;
  sum = (sum >> 8U) + (sum & 0xFFU);
  sum = (sum >> 8U) + (sum & 0xFFU);
  return static_cast<std::uint8_t>(sum);
}

inline std::uint16_t checksum16(std::span<const std::uint8_t> bytes) {
  unsigned sum = 0;
  for (const std::uint8_t byte : bytes) sum += byte;
  return static_cast<std::uint16_t>(sum);
}

inline void put16(Bytes& bytes, std::size_t at, std::uint16_t value) {
  bytes[at] = static_cast<std::uint8_t>(value);
  bytes[at + 1] = static_cast<std::uint8_t>(value >> 8U);
}

inline std::uint16_t get16(std::span<const std::uint8_t> bytes, std::size_t at) {
  return static_cast<std::uint16_t>(bytes[at] | (bytes[at + 1] << 8U));
}

/// Fills both checksums of an extended message, b2 included.
inline void seal_extended(Bytes& bytes) {
  bytes[2] = static_cast<std::uint8_t>((bytes.size() - 6) / 2);
  put16(bytes, 4, checksum16(std::span(bytes).subspan(6)));
  bytes[0] = checksum8(std::span(bytes).subspan(1, 5));
}

inline void seal_normal(Bytes& bytes) { bytes[0] = checksum8(std::span(bytes).subspan(1)); }

}  // namespace stickslip::emulated::u6
