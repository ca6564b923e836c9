// SPDX-License-Identifier: Apache-2.0
// CRC-32 as in zlib, Ethernet and PNG, available in any language.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <span>

namespace stickslip::protocol {

/// CRC-32 of the bytes added, in their order.
class Checksum {
 public:
  void add(std::uint8_t byte) { state_ = tables[0][(state_ ^ byte) & 0xFFU] ^ (state_ >> 8U); }

  /// The eight bytes of `word`, least significant first.
  void add_word(std::uint64_t word) {
    word ^= state_;
    state_ = 0;
    for (std::size_t i = 0; i < 8; ++i) state_ ^= tables[7 - i][(word >> (8 * i)) & 0xFFU];
  }

  /// The eight bytes of a number as LCM encodes it, most significant first.
  template <class Number>
  requires(sizeof(Number) == 8) void add_encoded(Number number) {
    add_word(__builtin_bswap64(std::bit_cast<std::uint64_t>(number)));
  }

  void add(std::span<const std::uint8_t> bytes) {
    for (; bytes.size() >= 16; bytes = bytes.subspan(16)) {
      add_words(little_endian(bytes.data()), little_endian(bytes.data() + 8));
    }
    for (const std::uint8_t byte : bytes) add(byte);
  }

  std::uint32_t value() const { return ~state_; }

 private:
  static std::uint64_t little_endian(const std::uint8_t* at) {
    std::uint64_t word = 0;
    std::memcpy(&word, at, sizeof word);
    return std::endian::native == std::endian::little ? word : __builtin_bswap64(word);
  }

  /// Sixteen bytes in one step: the two halves do not depend on each other.
  void add_words(std::uint64_t first, std::uint64_t second) {
    first ^= state_;
    std::uint32_t of_first = 0;
    std::uint32_t of_second = 0;
    for (std::size_t i = 0; i < 8; ++i) {
      of_first ^= tables[15 - i][(first >> (8 * i)) & 0xFFU];
      of_second ^= tables[7 - i][(second >> (8 * i)) & 0xFFU];
    }
    state_ = of_first ^ of_second;
  }

  // tables[n][b]: contribution of byte b followed by n further bytes.
  static constexpr std::array<std::array<std::uint32_t, 256>, 16> tables = [] {
    std::array<std::array<std::uint32_t, 256>, 16> out{};
    for (std::uint32_t b = 0; b < 256; ++b) {
      std::uint32_t r = b;
      for (int bit = 0; bit < 8; ++bit) r = (r >> 1U) ^ ((r & 1U) != 0 ? 0xEDB88320U : 0U);
      out[0][b] = r;
    }
    for (std::size_t n = 1; n < 16; ++n) {
      for (std::size_t b = 0; b < 256; ++b) {
        out[n][b] = out[0][out[n - 1][b] & 0xFFU] ^ (out[n - 1][b] >> 8U);
      }
    }
    return out;
  }();

  std::uint32_t state_ = 0xFFFFFFFFU;
};

}  // namespace stickslip::protocol
