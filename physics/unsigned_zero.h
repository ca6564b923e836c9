// SPDX-License-Identifier: Apache-2.0
// Zeros without a sign, in numbers that are written as text.
#pragma once

#include <array>
#include <charconv>
#include <concepts>
#include <string>

namespace stickslip::physics {

/// The same number, but for a zero, which has no sign.
constexpr double unsigned_zero(double value) { return value + 0.0; }

/// Appends the shortest decimal that reads back as the same number; 0 has no sign.
template <typename Number>
void append_shortest(std::string& out, Number value) {
  std::array<char, 40> text{};
  if constexpr (std::floating_point<Number>) value = unsigned_zero(value);
  out.append(text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr);
}

}  // namespace stickslip::physics
