// SPDX-License-Identifier: Apache-2.0
// The effective settings of a rig: the value of each key and its origin; differences of two rigs.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/key.h"
#include "config/rig.h"

namespace stickslip::config {

/// Effective value of one key of a rig.
struct Setting {
  const Key* key = nullptr;  ///< its entry in rig_keys()
  std::string path;          ///< with the stem of a channel for "*"
  /// As TOML, so that equal values have equal texts; paths relative to the working folder. Empty
  /// if the key has no value.
  std::string value;
  std::string words;  ///< effect of having no value: "until stopped"
  int line = 0;       ///< of the key in the file; 0: absent, `value` is the default
  int column = 0;

  bool stated() const { return line > 0; }
};

/// Every key of the rig's file in the order of the table, those with "*" once for each channel, as
/// in the file that was read (Rig::text), without overrides by a command line.
std::vector<Setting> settings_of(const Rig& rig);

/// The setting at a path, or null.
const Setting* find_setting(const std::vector<Setting>& settings, std::string_view path);

/// A text or a path without its quotes; empty if there is no such setting, or no value.
std::string plain_text(const std::vector<Setting>& settings, std::string_view path);

/// A key in which two rigs differ.
struct Change {
  std::string key;
  std::string before;  ///< its value as TOML, or the effect of having none
  std::string after;
  bool live = false;  ///< a running daemon applies it; otherwise it needs a restart

  friend bool operator==(const Change&, const Change&) = default;
};

/// Differences between two versions of a rig's file, in the order of the table. New contents of a
/// model file of the same name are a change of the key that names it. Comments, order and the
/// spelling of numbers are no change.
std::vector<Change> changes(const Rig& before, const Rig& after);

/// One line: "loop.rate_hz: 1000.0 -> 500.0, needs a restart".
std::string text(const Change& change);

}  // namespace stickslip::config
