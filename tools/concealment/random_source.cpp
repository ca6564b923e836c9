// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/random_source.h"

#include <cmath>
#include <numbers>

namespace stickslip::concealment {

double RandomSource::uniform(double low, double high) {
  const double unit = static_cast<double>(engine_() >> 11U) * 0x1.0p-53;
  return low + (high - low) * unit;
}

double RandomSource::log_uniform(double low, double high) {
  return low * std::exp(uniform(0.0, 1.0) * std::log(high / low));
}

double RandomSource::normal() {
  // Box-Muller; 1 - u is never 0.
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform(0.0, 1.0)));
  return radius * std::cos(2.0 * std::numbers::pi * uniform(0.0, 1.0));
}

std::size_t RandomSource::index(std::size_t count) {
  return static_cast<std::size_t>(uniform(0.0, static_cast<double>(count)));
}

}  // namespace stickslip::concealment
