// Formatting of numbers.
#pragma once

#include <array>
#include <charconv>
#include <cstdio>
#include <string>

namespace stickslip::physics {

/// Rounded to `digits` significant digits (1 to 17): "20.4", "1.03e+04", "0.0125".
inline std::string number_text(double value, int digits = 3) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.*g", digits, value);
  return text.data();
}

/// The shortest decimal that reads back as the same number.
inline std::string shortest_text(double value) {
  std::array<char, 40> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  return {text.data(), end};
}

}  // namespace stickslip::physics
