// SPDX-License-Identifier: Apache-2.0
#include "tools/terminal/text.h"

namespace stickslip::terminal {

namespace {

bool begins_character(char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U; }

std::string blanks_for(std::string_view text, std::size_t columns) {
  const std::size_t present = columns_in(text);
  return std::string(columns > present ? columns - present : 0, ' ');
}

}  // namespace

std::string printable(std::string_view text) {
  std::string out(text);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const auto byte = static_cast<unsigned char>(out[i]);
    if (byte < 0x20 || byte == 0x7F) out[i] = ' ';
    // U+0080 to U+009F are control characters, too.
    const bool second = i > 0 && static_cast<unsigned char>(out[i - 1]) == 0xC2U;
    if (second && byte >= 0x80 && byte < 0xA0) out[i - 1] = out[i] = ' ';
  }
  return out;
}

std::size_t columns_in(std::string_view text) {
  std::size_t count = 0;
  for (const char c : text) count += begins_character(c) ? 1U : 0U;
  return count;
}

std::string cut_to(std::string_view text, std::size_t columns) {
  if (columns_in(text) <= columns) return std::string(text);
  const std::string_view dots = columns > 6 ? "..." : "";
  const std::size_t keep = columns - dots.size();
  std::size_t end = 0;
  for (std::size_t seen = 0; end < text.size(); ++end) {
    if (begins_character(text[end]) && seen++ == keep) break;
  }
  return std::string(text.substr(0, end)) + std::string(dots);
}

std::string padded(std::string_view text, std::size_t columns) {
  return std::string(text) + blanks_for(text, columns);
}

std::string padded_left(std::string_view text, std::size_t columns) {
  return blanks_for(text, columns) + std::string(text);
}

}  // namespace stickslip::terminal
