// SPDX-License-Identifier: Apache-2.0
// Names of enumerators in configuration files. One table for each enumeration, next to it: files
// are read and written by it, and documentation and error messages list its names.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>
#include <type_traits>
#include <utility>

#include "physics/frame.h"

namespace stickslip::config {

template <class Enum>
using Name = std::pair<Enum, std::string_view>;

/// Specialised for each enumeration of the configuration: std::array of Name, in the order in which
/// documentation lists the choices.
template <class Enum>
inline constexpr std::nullptr_t names = nullptr;

template <class Enum>
concept Named = !std::is_null_pointer_v<std::remove_cv_t<decltype(names<Enum>)>>;

template <>
inline constexpr auto names<Channel> = [] {
  std::array<Name<Channel>, channel_count> out{};
  for (std::size_t i = 0; i < channel_count; ++i) {
    out[i] = {all_channels[i], info(all_channels[i]).stem};
  }
  return out;
}();

/// The names alone, in the order of a table of names.
template <auto& table>
inline constexpr auto names_in = [] {
  std::array<std::string_view, table.size()> out{};
  for (std::size_t i = 0; i < table.size(); ++i) out[i] = table[i].second;
  return out;
}();

/// Name of a value in a table of names; empty if it has none.
template <class Value, std::size_t size>
constexpr std::string_view name_in(const std::array<Name<Value>, size>& table, Value value) {
  for (const auto& [each, name] : table) {
    if (each == value) return name;
  }
  return {};
}

/// Value of that name in a table of names.
template <class Value, std::size_t size>
constexpr std::optional<Value> value_in(const std::array<Name<Value>, size>& table,
                                        std::string_view name) {
  for (const auto& [value, each] : table) {
    if (each == name) return value;
  }
  return std::nullopt;
}

template <Named Enum>
constexpr std::string_view name_of(Enum value) {
  return name_in(names<Enum>, value);
}

}  // namespace stickslip::config
