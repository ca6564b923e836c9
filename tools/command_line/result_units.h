// Units in results of a model: SI, or none where the model is dimensionless.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "physics/model.h"

namespace stickslip::command_line {

class ResultUnits {
 public:
  explicit ResultUnits(const physics::Model& model) : dimensionless_(model.dimensionless) {}

  bool dimensionless() const { return dimensionless_; }

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

  /// "drive.amplitude" of "drive.amplitude_m" in m.
  static std::string bare(std::string_view name, std::string_view unit) {
    const std::string suffix = suffix_of(unit);
    if (!suffix.empty() && name.ends_with(suffix)) name.remove_suffix(suffix.size());
    return std::string(name);
  }

 private:
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

}  // namespace stickslip::command_line
