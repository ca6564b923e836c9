// SPDX-License-Identifier: Apache-2.0
#include "physics/result_units.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>

#include "physics/number_text.h"

namespace stickslip::physics {
namespace {

/// A unit as sentences write it, and its size in SI units without a prefix.
struct UnitWord {
  std::string_view word;
  double size = 1.0;
};

// Longer words first.
constexpr std::array units = {UnitWord{"N s/m"},    UnitWord{"m/s2"},    UnitWord{"N/m2"},
                              UnitWord{"N/m3"},     UnitWord{"N/m5"},    UnitWord{"N/m"},
                              UnitWord{"m/s"},      UnitWord{"1/s"},     UnitWord{"1/m"},
                              UnitWord{"Hz"},       UnitWord{"kg"},      UnitWord{"N"},
                              UnitWord{"m"},        UnitWord{"s"},       UnitWord{"mm", 1e-3},
                              UnitWord{"ms", 1e-3}, UnitWord{"um", 1e-6}};

// A change per unit, in words.
constexpr std::array phrases = {
    std::pair<std::string_view, std::string_view>{"per millimetre", "per 0.001"},
    std::pair<std::string_view, std::string_view>{"at a millimetre", "at 0.001"},
    std::pair<std::string_view, std::string_view>{"per m/s", "per unit of velocity"},
    std::pair<std::string_view, std::string_view>{"per second", "per unit of time"}};

bool is_alphanumeric(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0; }

/// The unit that follows a number at the beginning of `text`, behind a space; null: none.
const UnitWord* unit_after_number(std::string_view text) {
  if (!text.starts_with(' ')) return nullptr;
  text.remove_prefix(1);
  const auto found = std::find_if(units.begin(), units.end(), [text](const UnitWord& unit) {
    if (!text.starts_with(unit.word)) return false;
    const std::string_view rest = text.substr(unit.word.size());
    return rest.empty() || !(is_alphanumeric(rest.front()) || rest.front() == '/');
  });
  return found == units.end() ? nullptr : &*found;
}

}  // namespace

std::string ResultUnits::without_units(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const auto phrase = std::find_if(phrases.begin(), phrases.end(), [text](const auto& each) {
      return text.starts_with(each.first);
    });
    if (phrase != phrases.end()) {
      out += phrase->second;
      text.remove_prefix(phrase->first.size());
      continue;
    }
    const bool begins = out.empty() || !(is_alphanumeric(out.back()) || out.back() == '_');
    const bool digit = text.front() >= '0' && text.front() <= '9';
    double value = 0.0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (!begins || !digit || error != std::errc()) {
      out += text.front();
      text.remove_prefix(1);
      continue;
    }
    const auto length = static_cast<std::size_t>(end - text.data());
    const UnitWord* unit = unit_after_number(text.substr(length));
    const bool scaled = unit != nullptr && unit->size != 1.0;
    out += scaled ? number_text(value * unit->size) : std::string(text.substr(0, length));
    text.remove_prefix(length + (unit == nullptr ? 0 : 1 + unit->word.size()));
  }
  return out;
}

}  // namespace stickslip::physics
