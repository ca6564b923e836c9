// SPDX-License-Identifier: Apache-2.0
// A number as a person writes it: "60 g +- 1 %", "2.40 +- 0.05 Hz".
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "physics/model.h"

namespace stickslip::interview {

/// Without blanks at both ends.
std::string_view trimmed(std::string_view text);

/// A unit that an answer may have; "" is a number without one. Units of one `kind` measure the same
/// quantity.
struct Unit {
  std::string_view name;
  int kind = 0;
  double factor = 1.0;               ///< to SI
  double usual_sigma_percent = 0.0;  ///< where an answer has no "+-"
};

/// `problem` is empty, or completes "expected ..." and the rest is void.
struct Quantity {
  physics::Parameter parameter;
  int kind = 0;
  std::string problem;
};

/// Reads VALUE [UNIT] [+- SIGMA [UNIT or %]]. "+- 0" is a number that is exact; without "+-" the
/// standard deviation is the usual one of the unit. A unit behind SIGMA only is that of both.
Quantity quantity_in(std::string_view text, std::span<const Unit> units);

}  // namespace stickslip::interview
