// SPDX-License-Identifier: Apache-2.0
// Rounding to significant digits.
#pragma once

#include <cstdio>
#include <cstdlib>

namespace stickslip::concealment {

inline double rounded(double value, int digits) {
  char text[40];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  return std::strtod(text, nullptr);
}

}  // namespace stickslip::concealment
