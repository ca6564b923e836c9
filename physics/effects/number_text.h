// Numbers as a person reads them.
#pragma once

#include <cstdio>
#include <string>

namespace stickslip::physics {

/// Three significant digits: "20.4", "1.03e+04", "0.0125".
inline std::string number_text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

}  // namespace stickslip::physics
