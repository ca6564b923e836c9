// SPDX-License-Identifier: Apache-2.0
#include "config/import_map.h"

#include <cmath>
#include <fstream>

#include "config/toml_nodes.h"
#include "physics/problem.h"

namespace stickslip::config {

namespace {

[[noreturn]] void refuse(const std::string& file, const toml::source_region& where,
                         const std::string& message) {
  const Place place = place_of(where);
  throw InputError(Problem{file, place.line, place.column, message});
}

std::string in_quotes(std::string_view text) {
  return std::string(1, '"').append(one_line(text)).append(1, '"');
}

void set_field(const std::string& file, std::string_view key, const toml::node& node,
               MappedColumn& out) {
  const auto text = node.value<std::string>();
  const auto number = number_in(&node);
  if (key == "channel" && text) {
    out.channel = *text;
  } else if (key == "unit" && text) {
    out.unit = *text;
  } else if (key == "factor" && number && std::isfinite(*number) && *number != 0.0) {
    out.factor *= *number;
  } else if (key == "sign" && number && std::abs(*number) == 1.0) {
    out.factor *= *number;
  } else {
    refuse(file, node.source(),
           in_quotes(key) + " is " + found_text(node) +
               "; expected channel and unit (texts), factor (a number, not 0) or sign (1 or -1)");
  }
}

MappedColumn column_of(const std::string& file, std::string_view name, const toml::node& node) {
  MappedColumn out{std::string(name), {}, {}, 1.0};
  if (const auto channel = node.value<std::string>()) {
    out.channel = *channel;
    return out;
  }
  const toml::table* table = node.as_table();
  if (table == nullptr) {
    refuse(file, node.source(),
           in_quotes(name) + " is " + found_text(node) +
               "; expected a channel, or { channel = ..., unit = ..., factor = ..., sign = ... }");
  }
  for (const auto& [key, value] : *table) set_field(file, key.str(), value, out);
  return out;
}

}  // namespace

std::vector<MappedColumn> load_import_map(const std::filesystem::path& file) {
  const std::string name = file.string();
  std::ifstream in(file, std::ios::binary);
  if (!in) throw InputError(Problem{name, 0, 0, "cannot be read; expected a mapping file (TOML)"});
  toml::table table;
  try {
    table = toml::parse(in, name);
  } catch (const toml::parse_error& error) {
    refuse(name, error.source(),
           one_line("is not valid TOML: " + std::string(error.description())));
  }
  std::vector<MappedColumn> out;
  for (const auto& [key, node] : table) out.push_back(column_of(name, key.str(), node));
  return out;
}

}  // namespace stickslip::config
