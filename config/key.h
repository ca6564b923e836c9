// The keys of the configuration files. One table for each kind of file, from which validation, its
// messages and the page of documentation come; the loaders only fetch what the table let through.
#pragma once

#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace stickslip::config {

enum class Type {
  number,        ///< a finite number
  integer,       ///< a whole number
  boolean,       ///< true or false
  text,          ///< a string
  choice,        ///< one of a few strings
  file,          ///< a path, relative to the file that names it
  parameter,     ///< a number, or { value = ..., sigma = ... }
  filters,       ///< an array of tables with the keys of filter_keys()
  envelope,      ///< an array of [time_s, amplitude]
  terms,         ///< [[physics]] tables with the keys of term_keys() and the effect's parameters
  date,          ///< ISO 8601 in a string
  texts,         ///< an array of strings
  range,         ///< [low, high]
  covariance,    ///< [variance, covariance, variance]
  leaks,         ///< { CHANNEL = number, ... }
  points,        ///< [[...point]] tables with the keys of point_keys()
  calibration,   ///< a table with the keys of calibration_keys()
  history,       ///< [[history]] tables with the keys of history_keys()
  lines,         ///< an array of [frequency_hz, amplitude, phase_deg]
  span,          ///< [from, to], two numbers, the second larger
  faults,        ///< [[fault]] tables with the keys of fault_keys()
  integers,      ///< an array of whole numbers
  modbus_units,  ///< [[modbus]] tables with the keys of modbus_unit_keys()
  gauges,        ///< [[gauge]] tables with the keys of gauge_keys()
  registers,     ///< [[register]] tables with the keys of register_keys()
};

enum class Need {
  optional,
  in_table,  ///< has to stand wherever its table stands
  always,    ///< has to stand
};

/// One key. In `path`, a segment "*" stands for the stem of a channel (displacement, velocity,
/// ...).
struct Key {
  std::string_view path;
  Type type = Type::number;
  std::string_view unit = {};  ///< "1" for pure numbers, empty for what is no number
  std::string_view sentence;
  Need need = Need::optional;
  std::string_view fallback = {};  ///< what holds without an optional key; empty: nothing
  /// "path=choice|choice": the key is needed (see `need`) only while the key at `path` is one of
  /// these; empty: whatever the others say.
  std::string_view when = {};
  bool only_then = false;  ///< the key may not stand while `when` does not hold
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool above_low = false;         ///< low itself is out of range
  std::string_view choices = {};  ///< Type::choice: in the order of the enumeration, by '|'
  /// Rigs: whether a running daemon takes a new value over (SIGHUP); else it needs a restart.
  bool live = false;
};

std::span<const Key> model_keys();
std::span<const Key> filter_keys();
std::span<const Key> term_keys();
std::span<const Key> rig_keys();
std::span<const Key> fault_script_keys();
std::span<const Key> fault_keys();
/// What `amount` is, by kind of fault: here a key's path is the kind.
std::span<const Key> fault_amount_keys();
/// fault_keys(), with what `amount` is for that kind; as they are where there is no such kind.
std::vector<Key> fault_keys_of(std::string_view kind);
std::span<const Key> calibration_file_keys();
std::span<const Key> calibration_keys();  ///< of one channel
std::span<const Key> history_keys();      ///< the same, and which channel
std::span<const Key> point_keys();
std::span<const Key> gauge_keys();
std::span<const Key> modbus_unit_keys();
std::span<const Key> modbus_map_keys();
std::span<const Key> register_keys();

/// Whether `path` is one that the key's path, "*" included, stands for.
bool matches(const Key& key, std::string_view path);

/// The key of that path in a table, or null.
const Key* find_key(std::span<const Key> keys, std::string_view path);

/// The parts of "a|b|c".
std::vector<std::string_view> choices_of(std::string_view list);

/// The choice at that position of the enumeration, as the file says it.
std::string_view choice_at(std::span<const Key> keys, std::string_view path, std::size_t position);

/// The shortest decimal that reads back to the same bits, as TOML writes a float ("2.4", "5.0").
std::string number_text(double value);

/// A string as TOML writes it, in quotes.
std::string string_text(std::string_view value);

/// What a value has to be, for messages: "a number above 0 [kg]".
std::string expectation(const Key& key);

/// What kind of value it is, in words: "whole number", "choice".
std::string_view name_of(Type type);

/// The range of a number, "above 0 to 1000", or the choices; empty where any value will do.
std::string range_of(const Key& key);

/// What holds, or happens, without the key: its fallback, or when it is required.
std::string absence_of(const Key& key);

/// The table of keys as a page of documentation (Markdown).
std::string keys_page();

}  // namespace stickslip::config
