// SPDX-License-Identifier: Apache-2.0
// Values as TOML text.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace stickslip::config {

/// Shortest decimal that reads back to the same bits, as a TOML float: "2.4", "5.0", "1e-05".
std::string toml_number(double value);

/// A string in quotes, with escapes.
std::string toml_string(std::string_view value);

/// Writes a TOML file line by line.
class TomlWriter {
 public:
  void table(std::string_view name);   ///< [name], after an empty line
  void tables(std::string_view name);  ///< [[name]], after an empty line
  void comment(std::string_view text);
  /// `value` is TOML already.
  void line(std::string_view key, std::string_view value);
  void number(std::string_view key, double value);
  void text(std::string_view key, std::string_view value);
  /// Values that are TOML already, between brackets: "[", "]".
  void list(std::string_view key, std::string_view open, const std::vector<std::string>& values,
            std::string_view close);
  std::string take();

 private:
  std::string text_;
};

}  // namespace stickslip::config
