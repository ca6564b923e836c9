// The keys of the project's configuration files: one table a kind of file, from which validation,
// the explanation on the command line and the documentation come.
#pragma once

#include <limits>
#include <span>
#include <string>
#include <string_view>

namespace stickslip::config {

enum class Type {
  number,     ///< a finite number
  integer,    ///< a whole number
  boolean,    ///< true or false
  text,       ///< a string
  choice,     ///< one of a few strings
  file,       ///< a path, relative to the file that names it
  parameter,  ///< a number, or { value = ..., sigma = ... }
  filters,    ///< an array of { kind, order, cutoff_hz }
  envelope,   ///< an array of [time_s, amplitude]
  terms,      ///< [[physics]] tables
};

/// One key. In `path`, a segment "*" stands for the stem of a channel (displacement, velocity,
/// ...).
struct Key {
  std::string_view path;
  Type type = Type::number;
  std::string_view unit;  ///< "1" for pure numbers, empty for what is no number
  std::string_view sentence;
  std::string_view fallback;  ///< what holds without it; "required" or "" where nothing does
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool above_low = false;         ///< low itself is out of range
  std::string_view choices = {};  ///< Type::choice: separated by '|'
};

std::span<const Key> model_keys();
std::span<const Key> rig_keys();

/// A name for a type as a person reads it.
std::string_view name_of(Type type);

/// The table of keys as the body of a page of documentation (Markdown).
std::string keys_page();

}  // namespace stickslip::config
