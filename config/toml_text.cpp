// SPDX-License-Identifier: Apache-2.0
#include "config/toml_text.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <utility>

namespace stickslip::config {

std::string toml_number(double value) {
  std::array<char, 40> digits{};
  const double size = std::abs(value);
  const bool plain = size == 0.0 || (size >= 1.0e-4 && size < 1.0e9);
  const auto result =
      std::to_chars(digits.data(), digits.data() + digits.size(), value,
                    plain ? std::chars_format::fixed : std::chars_format::scientific);
  std::string text(digits.data(), result.ptr);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}

std::string toml_string(std::string_view value) {
  std::string text = "\"";
  for (const char c : value) {
    if (c == '"' || c == '\\') {
      text += '\\';
      text += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      std::array<char, 8> escape{};
      std::snprintf(escape.data(), escape.size(), "\\u%04X", static_cast<unsigned>(c));
      text += escape.data();
    } else {
      text += c;
    }
  }
  return text + '"';
}

void TomlWriter::table(std::string_view name) { text_.append("\n[").append(name).append("]\n"); }

void TomlWriter::tables(std::string_view name) { text_.append("\n[[").append(name).append("]]\n"); }

void TomlWriter::comment(std::string_view text) { text_.append("# ").append(text).append("\n"); }

void TomlWriter::line(std::string_view key, std::string_view value) {
  text_.append(key).append(" = ").append(value).append("\n");
}

void TomlWriter::number(std::string_view key, double value) { line(key, toml_number(value)); }

void TomlWriter::text(std::string_view key, std::string_view value) {
  line(key, toml_string(value));
}

void TomlWriter::list(std::string_view key, std::string_view open,
                      const std::vector<std::string>& values, std::string_view close) {
  std::string joined;
  for (const std::string& value : values) joined.append(joined.empty() ? "" : ", ").append(value);
  line(key, std::string(open).append(joined).append(close));
}

std::string TomlWriter::take() { return std::move(text_); }

}  // namespace stickslip::config
