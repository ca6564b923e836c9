// SPDX-License-Identifier: Apache-2.0
#include "physics/formula_units.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <vector>

#include "physics/number_text.h"

namespace stickslip::physics {

namespace {

using Unit = std::optional<Dimension>;

enum Base : std::size_t { metre, kilogram, second, ampere, kelvin };

struct NamedUnit {
  std::string_view name;
  Dimension dimension;
};

constexpr std::array named_units = {
    NamedUnit{"m", {{1, 0, 0, 0, 0}}},   NamedUnit{"kg", {{0, 1, 0, 0, 0}}},
    NamedUnit{"s", {{0, 0, 1, 0, 0}}},   NamedUnit{"A", {{0, 0, 0, 1, 0}}},
    NamedUnit{"K", {{0, 0, 0, 0, 1}}},   NamedUnit{"N", {{1, 1, -2, 0, 0}}},
    NamedUnit{"Hz", {{0, 0, -1, 0, 0}}}, NamedUnit{"Pa", {{-1, 1, -2, 0, 0}}},
    NamedUnit{"J", {{2, 1, -2, 0, 0}}},  NamedUnit{"W", {{2, 1, -3, 0, 0}}},
    NamedUnit{"V", {{2, 1, -3, -1, 0}}}, NamedUnit{"rad", {{0, 0, 0, 0, 0}}},
    NamedUnit{"1", {{0, 0, 0, 0, 0}}},
};

Dimension product_of(const Dimension& a, const Dimension& b, double power = 1.0) {
  Dimension out = a;
  for (std::size_t i = 0; i < out.exponent.size(); ++i) out.exponent[i] += power * b.exponent[i];
  return out;
}

Dimension power_of(const Dimension& a, double power) { return product_of({}, a, power); }

// Reads a unit from left to right.
class UnitReader {
 public:
  explicit UnitReader(std::string_view text) : rest_(text) {}

  Unit whole() {
    const Unit unit = factors();
    return rest_.empty() ? unit : std::nullopt;
  }

 private:
  bool take(std::string_view mark) {
    if (!rest_.starts_with(mark)) return false;
    rest_.remove_prefix(mark.size());
    return true;
  }
  void blanks() {
    while (take(" ") || take("*") || take("\u00b7")) {
    }
  }

  Unit factors() {
    Dimension out;
    double sign = 1.0;
    bool any = false;
    for (blanks(); !rest_.empty() && rest_.front() != ')'; blanks()) {
      if (any && take("/")) {
        blanks();
        sign = -1.0;
      }
      const Unit next = factor();
      if (!next) return std::nullopt;
      out = product_of(out, *next, sign);
      sign = 1.0;
      any = true;
    }
    return any ? Unit(out) : std::nullopt;
  }

  Unit factor() {
    Unit unit;
    if (take("(")) {
      unit = factors();
      if (!take(")")) return std::nullopt;
    } else {
      unit = name();
    }
    if (!unit) return std::nullopt;
    const std::optional<double> power = exponent();
    return power ? Unit(power_of(*unit, *power)) : std::nullopt;
  }

  Unit name() {
    std::size_t length = 0;
    while (length < rest_.size() && std::isalpha(static_cast<unsigned char>(rest_[length])) != 0) {
      ++length;
    }
    if (length == 0 && rest_.starts_with('1')) length = 1;
    const auto* const found =
        std::find_if(named_units.begin(), named_units.end(),
                     [&](const NamedUnit& each) { return each.name == rest_.substr(0, length); });
    if (length == 0 || found == named_units.end()) return std::nullopt;
    rest_.remove_prefix(length);
    return found->dimension;
  }

  // 1 where there is none.
  std::optional<double> exponent() {
    constexpr std::array<std::string_view, 5> raised = {"\u2070", "\u00b9", "\u00b2", "\u00b3",
                                                        "\u2074"};
    const bool below = take("\u207b");
    for (std::size_t i = 0; i < raised.size(); ++i) {
      if (take(raised[i])) return (below ? -1.0 : 1.0) * static_cast<double>(i);
    }
    if (below) return std::nullopt;
    const bool marked = take("^");
    const double sign = marked && take("-") ? -1.0 : 1.0;
    if (rest_.empty() || std::isdigit(static_cast<unsigned char>(rest_.front())) == 0) {
      return marked ? std::nullopt : std::optional(1.0);
    }
    const double digit = rest_.front() - '0';
    rest_.remove_prefix(1);
    return sign * digit;
  }

  std::string_view rest_;
};

// ---- Units of results --------------------------------------------------------------------------

class UnitCheck {
 public:
  UnitCheck(const Formula& formula, std::span<const Unit> symbols)
      : formula_(formula), units_(symbols.begin(), symbols.end()) {}

  Unit run() {
    for (const Formula::Operation& operation : formula_.operations()) {
      units_.push_back(unit_of(operation));
    }
    return units_[formula_.result()];
  }

 private:
  Unit unit_of(const Formula::Operation& o) const {
    const Unit left = units_[o.left];
    const Unit right = units_[o.right];
    switch (o.op) {
      case Operator::constant:
        return o.number == 0.0 ? Unit() : Dimension{};  // 0 has every unit
      case Operator::negate:
      case Operator::abs:
      case Operator::times_number:
      case Operator::over_number:
        return left;
      case Operator::add:
      case Operator::subtract:
      case Operator::min:
      case Operator::max:
        return equal(left, right, o);
      case Operator::add_number:
      case Operator::number_minus:
        return o.number == 0.0 ? left : equal(left, Dimension{}, o);
      case Operator::multiply:
        return left && right ? Unit(product_of(*left, *right)) : Unit();
      case Operator::divide:
        return left && right ? Unit(product_of(*left, *right, -1.0)) : Unit();
      case Operator::number_over:
        return left ? Unit(power_of(*left, -1.0)) : Unit();
      case Operator::whole_power:
      case Operator::number_power:
        return left ? Unit(power_of(*left, o.number)) : Unit();
      case Operator::sqrt:
        return left ? Unit(power_of(*left, 0.5)) : Unit();
      case Operator::power:
        return power(left, right, o);
      case Operator::sign:
        return Dimension{};
      default:
        pure(left, "the argument of this function is a pure number", o);
        return Dimension{};
    }
  }

  static Unit equal(const Unit& left, const Unit& right, const Formula::Operation& o) {
    if (left && right && !(*left == *right)) {
      throw FormulaError(o.offset, "combines the units " + unit_text(*left) + " and " +
                                       unit_text(*right) + ": expected the same on both sides");
    }
    return left ? left : right;
  }

  static Unit power(const Unit& base, const Unit& exponent, const Formula::Operation& o) {
    pure(exponent, "an exponent is a pure number", o);
    pure(base, "the base of an exponent that is no plain number is a pure number", o);
    return Dimension{};
  }

  static void pure(const Unit& unit, const std::string& what, const Formula::Operation& o) {
    if (unit && !(*unit == Dimension{})) {
      throw FormulaError(o.offset, what + ", found the unit " + unit_text(*unit));
    }
  }

  const Formula& formula_;
  std::vector<Unit> units_;
};

std::string factor_text(std::string_view name, double exponent) {
  std::string text(name);
  if (exponent != 1.0) text.append("^").append(number_text(exponent));
  return text;
}

}  // namespace

std::optional<Dimension> dimension_of(std::string_view unit) { return UnitReader(unit).whole(); }

std::string unit_text(const Dimension& dimension) {
  auto left = dimension.exponent;
  std::vector<std::pair<std::string_view, double>> factors;
  // Forces are more common than masses here.
  if (left[kilogram] != 0.0 && (left[second] != 0.0 || left[metre] != 0.0)) {
    const double newtons = left[kilogram];
    factors.emplace_back("N", newtons);
    left[metre] -= newtons;
    left[second] += 2.0 * newtons;
    left[kilogram] = 0.0;
  }
  constexpr std::array<std::string_view, 5> names = {"m", "kg", "s", "A", "K"};
  for (const Base base : {kilogram, metre, second, ampere, kelvin}) {
    factors.emplace_back(names[base], left[base]);
  }
  std::string above;
  std::string below;
  for (const auto& [name, exponent] : factors) {
    std::string& side = exponent > 0.0 ? above : below;
    if (exponent == 0.0) continue;
    if (!side.empty()) side += ' ';
    side += factor_text(name, std::abs(exponent));
  }
  if (above.empty()) above += '1';
  if (below.empty()) return above;
  const bool several = below.find(' ') != std::string::npos;
  above.append("/").append(several ? "(" : "").append(below).append(several ? ")" : "");
  return above;
}

std::optional<Dimension> dimension_of(const Formula& formula,
                                      std::span<const std::optional<Dimension>> symbols) {
  return UnitCheck(formula, symbols).run();
}

}  // namespace stickslip::physics
