// SPDX-License-Identifier: Apache-2.0
#include "config/toml_nodes.h"

#include <charconv>
#include <cmath>
#include <sstream>
#include <system_error>

#include "config/toml_text.h"

namespace stickslip::config {

namespace {

const toml::node* element_at(const toml::array& list, std::string_view number) {
  std::size_t index = 0;
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), index);
  const bool all = error == std::errc{} && end == number.data() + number.size();
  return all ? list.get(index) : nullptr;
}

/// Finite numbers in a list of this length.
template <std::size_t size>
std::optional<std::array<double, size>> numbers_in(const toml::node* node) {
  const toml::array* list = node != nullptr ? node->as_array() : nullptr;
  if (list == nullptr || list->size() != size) return std::nullopt;
  std::array<double, size> out{};
  for (std::size_t i = 0; i < size; ++i) {
    const auto number = number_in(list->get(i));
    if (!number || !std::isfinite(*number)) return std::nullopt;
    out[i] = *number;
  }
  return out;
}

}  // namespace

Place place_of(const toml::source_region& region) {
  return {static_cast<int>(region.begin.line), static_cast<int>(region.begin.column)};
}

std::string joined_path(std::string_view prefix, std::string_view name) {
  std::string path(prefix);
  if (!path.empty()) path += '.';
  return path += name;
}

std::string_view parent_of(std::string_view path) {
  const auto dot = path.rfind('.');
  return dot == std::string_view::npos ? std::string_view{} : path.substr(0, dot);
}

std::string_view last_name(std::string_view path) {
  const auto dot = path.rfind('.');
  return dot == std::string_view::npos ? path : path.substr(dot + 1);
}

const toml::node* node_at(const toml::table& root, std::string_view path) {
  const toml::node* node = &root;
  while (true) {
    const auto dot = path.find('.');
    const std::string_view name = path.substr(0, dot);
    if (const toml::table* table = node->as_table()) {
      node = table->get(name);
    } else if (const toml::array* list = node->as_array()) {
      node = element_at(*list, name);
    } else {
      return nullptr;
    }
    if (node == nullptr || dot == std::string_view::npos) return node;
    path = path.substr(dot + 1);
  }
}

std::optional<double> number_in(const toml::node* node) {
  if (node == nullptr || !node->is_number()) return std::nullopt;
  return node->value<double>();
}

std::optional<std::array<double, 2>> pair_in(const toml::node* node) { return numbers_in<2>(node); }

std::optional<LineCovariance> covariance_in(const toml::node* node) {
  const auto numbers = numbers_in<3>(node);
  if (!numbers) return std::nullopt;
  return LineCovariance{(*numbers)[0], (*numbers)[1], (*numbers)[2]};
}

std::string found_text(const toml::node& node) {
  if (node.is_table()) return "a table";
  if (node.is_array()) return "a list";
  std::string out;
  node.visit([&out](const auto& value) {
    using Node = decltype(value);
    if constexpr (toml::is_string<Node>) {
      out = '"' + *value + '"';
    } else if constexpr (toml::is_floating_point<Node>) {
      out = toml_number(*value);
    } else if constexpr (toml::is_value<Node>) {
      std::ostringstream text;
      text << value;
      out = text.str();
    }
  });
  constexpr std::size_t longest = 60;
  if (out.size() > longest) {
    // Not in the middle of a UTF-8 character.
    std::size_t end = longest;
    while (end > 0 && (static_cast<unsigned char>(out[end]) & 0xC0U) == 0x80U) --end;
    out = out.substr(0, end) + "...";
  }
  return out;
}

std::string toml_text(const toml::node& node, bool whole) {
  std::string out;
  if (const toml::table* table = node.as_table()) {
    for (const auto& [name, inner] : *table) {
      out += (out.empty() ? "{ " : ", ") + std::string(name.str()) + " = " +
             toml_text(inner, whole || name.str() == "order");
    }
    return out.empty() ? "{}" : out + " }";
  }
  if (const toml::array* list = node.as_array()) {
    for (const toml::node& inner : *list)
      out += (out.empty() ? "" : ", ") + toml_text(inner, whole);
    return '[' + out + ']';
  }
  if (const auto text = node.value_exact<std::string_view>()) return toml_string(*text);
  if (const auto flag = node.value_exact<bool>()) return *flag ? "true" : "false";
  if (whole && node.is_integer()) return std::to_string(*node.value_exact<std::int64_t>());
  return toml_number(number_in(&node).value_or(0.0));
}

std::string one_line(std::string_view text) {
  std::string out;
  for (char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte == '\n') {
      out += "\\n";
    } else if (byte == '\t') {
      out += "\\t";
    } else if (byte < 0x20 || byte == 0x7f) {
      out += '?';
    } else {
      out += c;
    }
  }
  return out;
}

}  // namespace stickslip::config
