// SPDX-License-Identifier: Apache-2.0
// Units of formulas: what unit a formula has, given those of its symbols.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "physics/formula.h"

namespace stickslip::physics {

/// Exponents of m, kg, s, A and K. All 0: a pure number.
struct Dimension {
  std::array<double, 5> exponent{};

  friend bool operator==(const Dimension&, const Dimension&) = default;
};

/// Of SI units without prefix, as in "N s/m", "N/m^3", "N s2/m2", "1/(m s)" or "1". Empty for any
/// other text.
std::optional<Dimension> dimension_of(std::string_view unit);

/// "N s/m"; "1" for a pure number.
std::string unit_text(const Dimension& dimension);

/// The unit of a formula; `symbols`: those of its symbols, empty where unknown. Empty where it
/// depends on an unknown one. Numbers in the formula are pure. Throws FormulaError where units
/// contradict each other.
std::optional<Dimension> dimension_of(const Formula& formula,
                                      std::span<const std::optional<Dimension>> symbols);

}  // namespace stickslip::physics
