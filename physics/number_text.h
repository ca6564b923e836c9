// SPDX-License-Identifier: Apache-2.0
// Formatting of numbers.
#pragma once

#include <array>
#include <charconv>
#include <concepts>
#include <cstdio>
#include <string>

namespace stickslip::physics {

/// The text of one number, in which a zero has no sign: "-0.00" becomes "0.00".
inline std::string with_unsigned_zero(std::string text) {
  const bool zero = text.find_first_not_of("+-0.e ") == std::string::npos;
  if (zero && text.starts_with('-')) text.erase(0, 1);
  return text;
}

/// Rounded to `digits` significant digits (1 to 17): "20.4", "1.03e+04", "0.0125".
inline std::string number_text(double value, int digits = 3) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.*g", digits, value);
  return with_unsigned_zero(text.data());
}

/// A share as a percentage of `digits` significant digits: "12.5 %".
inline std::string percent_text(double share, int digits = 3) {
  return number_text(100.0 * share, digits) + " %";
}

/// With `decimals` digits behind the point: "20.400"; `sign`: "+20.400".
inline std::string fixed_text(double value, int decimals, bool sign = false) {
  std::array<char, 340> text{};
  std::snprintf(text.data(), text.size(), sign ? "%+.*f" : "%.*f", decimals, value);
  return with_unsigned_zero(text.data());
}

/// A count with its noun: "1 frame", "2 frames"; `plural` where it is not formed by an s.
template <std::integral Count>
std::string counted(Count count, const std::string& noun, const std::string& plural = {}) {
  if (count == 1) return "1 " + noun;
  return std::to_string(count) + ' ' + (plural.empty() ? noun + 's' : plural);
}

/// The shortest decimal that reads back as the same number; 0 has no sign.
inline std::string shortest_text(double value) {
  std::array<char, 40> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  return with_unsigned_zero({text.data(), end});
}

}  // namespace stickslip::physics
