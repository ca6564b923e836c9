// SPDX-License-Identifier: Apache-2.0
// Units in results of a model: SI, or none where the model is dimensionless.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>

#include "physics/model.h"

namespace stickslip::physics {

class ResultUnits {
 public:
  explicit ResultUnits(const Model& model) : dimensionless_(model.dimensionless) {}

  bool dimensionless() const { return dimensionless_; }

  /// "m/s" of "m/s"; "1" without units.
  std::string_view of(std::string_view unit) const { return dimensionless_ ? "1" : unit; }

  /// A sentence about quantities; without units those behind its numbers are left out, and the
  /// numbers are in whole units: "after 2 mm, with 3 N/m" becomes "after 0.002, with 3".
  std::string sentence(std::string text) const {
    return dimensionless_ ? without_units(text) : std::move(text);
  }

  /// " m" behind a number; empty for the unit "1".
  std::string after_number(std::string_view unit) const {
    std::string text;
    if (!dimensionless_ && !is_one(unit)) text.append(1, ' ').append(unit);
    return text;
  }

  /// "x [m]", the label of an axis.
  std::string axis(std::string_view name, std::string_view unit) const {
    std::string label(name);
    if (!dimensionless_ && !is_one(unit)) label.append(" [").append(unit).append("]");
    return label;
  }

  /// "displacement_m": a name that ends in its unit, as a column; "displacement" without units.
  std::string column(std::string_view name, std::string_view unit) const {
    return dimensionless_ ? bare(name, unit) : std::string(name);
  }

  /// The same for a name that ends in the unit of a quantity of the motion: "velocity_m_s".
  std::string column(std::string_view name) const {
    if (!dimensionless_) return std::string(name);
    for (const std::string_view unit : {"m/s", "1/s", "m", "N", "s"}) {
      if (std::string bare_name = bare(name, unit); bare_name != name) return bare_name;
    }
    return std::string(name);
  }

  /// "drive.amplitude" of "drive.amplitude_m" in m.
  static std::string bare(std::string_view name, std::string_view unit) {
    const std::string suffix = suffix_of(unit);
    if (!suffix.empty() && name.ends_with(suffix)) name.remove_suffix(suffix.size());
    return std::string(name);
  }

 private:
  static std::string without_units(std::string_view text);
  static bool is_one(std::string_view unit) { return unit.empty() || unit == "1"; }

  // "_m_s2" of "m/s2", "_per_s" of "1/s", "_hz" of "Hz"
  static std::string suffix_of(std::string_view unit) {
    if (is_one(unit)) return "";
    std::string out = "_";
    if (unit.starts_with("1/")) {
      out += "per_";
      unit.remove_prefix(2);
    }
    for (const char c : unit) {
      if (c == '/' || c == ' ') out += '_';
      if (c >= '0' && c <= '9') out += c;
      if (c >= 'a' && c <= 'z') out += c;
      if (c >= 'A' && c <= 'Z') out += static_cast<char>(c - 'A' + 'a');
    }
    return out;
  }

  bool dimensionless_;
};

}  // namespace stickslip::physics
