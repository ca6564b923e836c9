// What holds in a rig, key by key: the value, and where it comes from. Two rigs differ by the keys
// whose values do.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/key.h"
#include "config/rig.h"

namespace stickslip::config {

/// One key of a rig as it is in effect.
struct Setting {
  const Key* key = nullptr;  ///< its entry in rig_keys()
  std::string path;          ///< a channel's stem stands where the entry has "*"
  /// As TOML writes it, so that equal values have equal texts; paths as seen from the working
  /// folder. Empty where no value holds.
  std::string value;
  std::string words;  ///< where none does, what happens instead: "until told to stop"
  int line = 0;       ///< of the file that says it; 0: it does not, `value` is the default
  int column = 0;

  bool stated() const { return line > 0; }
};

/// Every key of the rig's file in the order of the table, those with "*" once for each channel.
/// Speaks of the file as it was read (Rig::text): not of what a command line says beyond it.
std::vector<Setting> settings_of(const Rig& rig);

/// The setting at a path, or null.
const Setting* find_setting(const std::vector<Setting>& settings, std::string_view path);

/// A text or a path without its quotes; empty where there is no such setting or no value.
std::string plain_text(const std::vector<Setting>& settings, std::string_view path);

/// A key that two rigs do not agree on.
struct Change {
  std::string key;
  std::string before;  ///< its value as TOML writes it, or what happens without one
  std::string after;
  bool live = false;  ///< a running daemon takes it over; else it needs a restart

  friend bool operator==(const Change&, const Change&) = default;
};

/// What changed in the file of a rig from one reading to the next, in the order of the table. A
/// model whose file kept its name and says something else counts as a change of the key that names
/// it. Comments, order and the spelling of numbers are no change.
std::vector<Change> changes(const Rig& before, const Rig& after);

/// One line for a person: "loop.rate_hz: 1000.0 -> 500.0, needs a restart".
std::string text(const Change& change);

}  // namespace stickslip::config
