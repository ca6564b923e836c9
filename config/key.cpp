// SPDX-License-Identifier: Apache-2.0
#include "config/key.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "config/toml_text.h"
#include "physics/frame.h"
#include "physics/number_text.h"

namespace stickslip::config {

namespace {

/// A type in words: its name in documentation, and the expected value in messages. Empty where the
/// key itself determines the text.
struct TypeWords {
  Type type;
  std::string_view name;
  std::string_view expected;
};

constexpr auto type_words = std::to_array<TypeWords>({
    {Type::number, "number", "a number"},
    {Type::integer, "whole number", "a whole number"},
    {Type::boolean, "true or false", "true or false"},
    {Type::text, "text", "a text in quotes"},
    {Type::choice, "choice", ""},
    {Type::file, "path", "the path of a file in quotes"},
    {Type::parameter, "parameter", "a number or { value = ..., sigma = ... }"},
    {Type::date, "date", "a date in quotes, such as \"2026-11-22\" or \"2026-11-22T14:03:00Z\""},
    {Type::texts, "texts", "a list of texts in quotes"},
    {Type::integers, "whole numbers", "a list of whole numbers, [0, 1]"},
    {Type::range, "[low, high]", ""},
    {Type::span, "two numbers", "two numbers, [from, to], the second larger"},
    {Type::covariance, "three numbers",
     "[variance of the offset, covariance, variance of the gain]"},
    {Type::crosstalk, "{ CHANNEL = number }",
     "{ CHANNEL = number, ... } with the names of other channels"},
    {Type::envelope, "points", "a list of points, [[time_s, amplitude], ...]"},
    {Type::lines, "lines", "a list of lines, [[frequency_hz, amplitude, phase_deg], ...]"},
    {Type::filters, "filters",
     "a list of filters, [ { kind = \"butterworth_lowpass\", order = 4, cutoff_hz = 25.0 } ]"},
    {Type::terms, "tables", "[[physics]] tables"},
    {Type::numbers, "{ NAME = number }", "a table of numbers, { NAME = number, ... }"},
    {Type::parameters, "{ NAME = parameter }",
     "{ NAME = { value = ..., sigma = ..., unit = \"...\" }, ... }"},
    {Type::states, "{ NAME = state }",
     "{ NAME = { rate = \"...\", within = \"...\", unit = \"...\", size = ... }, ... }"},
    {Type::faults, "tables", "[[fault]] tables"},
    {Type::calibration, "table", "a table with offset, gain, date, reference"},
    {Type::tables, "tables", ""},
});

const TypeWords& words_of(Type type) {
  return *std::find_if(type_words.begin(), type_words.end(),
                       [type](const TypeWords& each) { return each.type == type; });
}

std::string bound_text(double value) { return physics::number_text(value, 6); }

std::string range_text(const Key& key) {
  const bool low = std::isfinite(key.low);
  const bool high = std::isfinite(key.high);
  if (low && high) {
    return key.low == key.high ? bound_text(key.low)
                               : (key.above_low ? "above " : "from ") + bound_text(key.low) +
                                     " to " + bound_text(key.high);
  }
  if (low) return key.above_low ? "above " + bound_text(key.low) : bound_text(key.low) + " or more";
  if (high) return bound_text(key.high) + " or less";
  return "";
}

std::string quoted_choices(std::span<const std::string_view> choices, std::string_view last) {
  std::string text;
  for (std::size_t i = 0; i < choices.size(); ++i) {
    if (i > 0) text += i + 1 == choices.size() ? last : ", ";
    text += '"' + std::string(choices[i]) + '"';
  }
  return text;
}

/// Condition of a key in words: "with kind replay".
std::string condition_text(const Key& key) {
  const auto equals = key.when.find('=');
  const auto path = key.when.substr(0, equals);
  const auto dot = path.rfind('.');
  std::string text = " with ";
  text += dot == std::string_view::npos ? path : path.substr(dot + 1);
  text += ' ';
  for (const char c : key.when.substr(equals + 1)) {
    text += c == '|' ? std::string(" or ") : std::string(1, c);
  }
  return text;
}

/// A TOML value as plain text: "5" for 5.0, without quotes.
std::string plain_text(std::string text) {
  if (text.ends_with(".0")) text.resize(text.size() - 2);
  if (text.size() >= 2 && text.front() == '"') text = text.substr(1, text.size() - 2);
  return text;
}

}  // namespace

std::string_view name_of(Type type) { return words_of(type).name; }

std::string range_of(const Key& key) {
  return key.type == Type::choice ? quoted_choices(key.choices, ", ") : range_text(key);
}

std::string default_value(const Key& key) {
  const bool none = key.need != Need::optional || !key.without.empty() || key.in_optional;
  return none || key.initial == nullptr ? std::string() : key.initial();
}

std::string absence_of(const Key& key) {
  if (key.need == Need::optional) {
    if (!key.without.empty() || key.initial == nullptr) return std::string(key.without);
    return plain_text(key.initial());
  }
  std::string text = "required";
  if (key.need == Need::in_table) {
    text += " in [" + std::string(key.path.substr(0, key.path.rfind('.'))) + "]";
  }
  if (!key.when.empty()) {
    text += condition_text(key);
    if (key.only_then) text += "; not otherwise";
  }
  return text;
}

bool matches(const Key& key, std::string_view path) {
  const auto star = key.path.find('*');
  if (star == std::string_view::npos) return key.path == path;
  const std::string_view after = key.path.substr(star + 1);
  if (path.size() < star + after.size() || path.substr(0, star) != key.path.substr(0, star) ||
      path.substr(path.size() - after.size()) != after) {
    return false;
  }
  const std::string_view stem = path.substr(star, path.size() - star - after.size());
  for (const ChannelInfo& channel : channel_table) {
    if (channel.stem == stem) return true;
  }
  return false;
}

std::vector<std::string> paths_of(const Key& key) {
  const auto star = key.path.find('*');
  if (star == std::string_view::npos) return {std::string(key.path)};
  std::vector<std::string> out;
  for (const Channel channel : all_channels) {
    out.push_back(std::string(key.path).replace(star, 1, info(channel).stem));
  }
  return out;
}

const Key* find_key(std::span<const Key> keys, std::string_view path) {
  for (const Key& key : keys) {
    if (matches(key, path)) return &key;
  }
  return nullptr;
}

std::vector<std::string_view> alternatives_in(std::string_view list) {
  std::vector<std::string_view> out;
  while (!list.empty()) {
    const auto bar = list.find('|');
    out.push_back(list.substr(0, bar));
    list = bar == std::string_view::npos ? std::string_view{} : list.substr(bar + 1);
  }
  return out;
}

std::string expectation(const Key& key) {
  switch (key.type) {
    case Type::choice:
      return quoted_choices(key.choices, " or ");
    case Type::range:
      return "[low, high] with low below high [" + std::string(key.unit) + "]";
    case Type::tables:
      return "[[" + std::string(key.header.empty() ? key.path : key.header) + "]] tables";
    default:
      break;
  }
  std::string text(words_of(key.type).expected);
  const bool ranged = key.type == Type::number || key.type == Type::integer ||
                      key.type == Type::parameter || key.type == Type::span;
  if (!ranged) return text;
  const std::string range = range_text(key);
  if (!range.empty()) text += ", " + range;
  if (!key.unit.empty() && key.unit != "1" && key.unit.find(" or ") == std::string_view::npos &&
      key.unit.find("the ") != 0) {
    text += " [" + std::string(key.unit) + "]";
  }
  return text;
}

}  // namespace stickslip::config
