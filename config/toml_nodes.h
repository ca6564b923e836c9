// SPDX-License-Identifier: Apache-2.0
// Access to nodes of a parsed TOML file.
#pragma once

#include <toml++/toml.h>

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "config/calibration.h"

namespace stickslip::config {

/// Line and column, from 1; 0 for a node without a place in the file.
struct Place {
  int line = 0;
  int column = 0;
};

Place place_of(const toml::source_region& region);

/// "loop" and "rate_hz": "loop.rate_hz".
std::string joined_path(std::string_view prefix, std::string_view name);

/// "loop" of "loop.rate_hz"; empty for a path of one segment.
std::string_view parent_of(std::string_view path);

/// "rate_hz" of "loop.rate_hz".
std::string_view last_name(std::string_view path);

/// The node at a path of tables, and of positions in lists, or null.
const toml::node* node_at(const toml::table& root, std::string_view path);

/// A number, whole or not; empty for another type or a null node.
std::optional<double> number_in(const toml::node* node);

/// Two finite numbers in a list.
std::optional<std::array<double, 2>> pair_in(const toml::node* node);

/// Three finite numbers in a list.
std::optional<LineCovariance> covariance_in(const toml::node* node);

/// A value as shown in messages, at most 60 bytes.
std::string found_text(const toml::node& node);

/// A node as TOML on one line. `whole`: whole numbers remain so; otherwise 2 becomes 2.0.
std::string toml_text(const toml::node& node, bool whole);

/// A message on one line for any characters of the file.
std::string one_line(std::string_view text);

}  // namespace stickslip::config
