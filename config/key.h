// SPDX-License-Identifier: Apache-2.0
// The keys of the configuration files. One entry for each key holds everything about it: its path,
// type, unit, range and meaning, and the member that it is read into (key_binding.h), whose initial
// value is the default. Validation, error messages, reading and documentation use that entry.
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "config/value.h"

namespace stickslip::config {

enum class Type {
  number,       ///< a finite number
  integer,      ///< a whole number
  boolean,      ///< true or false
  text,         ///< a string
  choice,       ///< one of a few strings
  file,         ///< a path, relative to the file that names it
  parameter,    ///< a number, or { value = ..., sigma = ... }
  date,         ///< ISO 8601 in a string
  texts,        ///< an array of strings
  integers,     ///< an array of whole numbers
  range,        ///< [low, high]
  span,         ///< [from, to], two numbers, the second larger
  covariance,   ///< [variance, covariance, variance]
  crosstalk,    ///< { CHANNEL = number, ... }
  envelope,     ///< an array of [time_s, amplitude]
  lines,        ///< an array of [frequency_hz, amplitude, phase_deg]
  filters,      ///< an array of tables with the keys of a filter
  terms,        ///< [[physics]] tables, which have the effect's parameters as further keys
  numbers,      ///< { NAME = number, ... }; tables in it lengthen the names
  parameters,   ///< { NAME = { value, sigma, unit }, ... }
  states,       ///< { NAME = { rate, within, unit, size }, ... }
  faults,       ///< [[fault]] tables
  calibration,  ///< a table with the keys of one channel's calibration
  tables,       ///< an array of tables
};

enum class Need {
  optional,
  in_table,  ///< required if its table is present
  always,    ///< required
};

/// One key. In `path`, a segment "*" stands for the stem of a channel (displacement, velocity,
/// ...).
struct Key {
  std::string_view path;
  std::string_view unit = {};  ///< "1" for pure numbers, empty for other types
  std::string_view sentence;
  Need need = Need::optional;
  /// Effect of leaving the key out, if that is not the member's initial value: "not measured".
  std::string_view without = {};
  /// "path=choice|choice": the key is required (see `need`) only while the key at `path` is one of
  /// these; empty: unconditional.
  std::string_view when = {};
  bool only_then = false;  ///< the key is an error while `when` does not hold
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool above_low = false;  ///< low itself is out of range
  /// Rigs: a running daemon applies a new value (SIGHUP); otherwise it needs a restart.
  bool live = false;
  bool written = false;  ///< Type::file: the daemon writes it; otherwise it is read
  /// Type::tables: largest number of them, and the header in messages where it is not the path.
  std::size_t most = std::numeric_limits<std::size_t>::max();
  std::string_view header = {};

  // Of the member that the key is bound to.
  Type type = Type::number;
  std::span<const std::string_view> choices = {};  ///< Type::choice
  std::span<const Key> (*columns)() = nullptr;     ///< Type::tables: keys of each table
  bool in_optional = false;                        ///< the member exists only if its table does
  std::string (*initial)() = nullptr;              ///< as TOML; empty: no value
  void (*assign)(void* object, std::size_t channel, const Value& value) = nullptr;
};

/// True if `path` is one that the key's path, "*" included, stands for.
bool matches(const Key& key, std::string_view path);

/// Paths that the key's path stands for, by channel; one if it has no "*".
std::vector<std::string> paths_of(const Key& key);

/// Keys of a rig file, and of a model file; key_tables.h has the others.
std::span<const Key> rig_keys();
std::span<const Key> model_keys();

/// The key of that path in a table, or null.
const Key* find_key(std::span<const Key> keys, std::string_view path);

/// The parts of "a|b|c".
std::vector<std::string_view> alternatives_in(std::string_view list);

/// Expected value, for messages: "a number above 0 [kg]".
std::string expectation(const Key& key);

/// Type of the value in words: "whole number", "choice".
std::string_view name_of(Type type);

/// Range of a number, "above 0 to 1000", or the choices; empty if there is no restriction.
std::string range_of(const Key& key);

/// Default as TOML; empty if there is none, or if it applies only within an optional table.
std::string default_value(const Key& key);

/// Default in plain text, or the effect of leaving the key out, or when it is required.
std::string absence_of(const Key& key);

/// The keys as a page of documentation (Markdown).
std::string keys_page();

}  // namespace stickslip::config
