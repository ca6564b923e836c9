// A stretch of time with edges that a fit can move.
#pragma once

#include <cmath>

#include "physics/dual.h"

namespace stickslip::physics {

/// 1 between `begin_s` and `end_s`, 0 before and after, with edges of a few hundredths of a second.
template <class T>
T during(double time_s, const T& begin_s, const T& end_s) {
  using std::tanh;
  constexpr double edge_s = 0.03;
  return 0.5 * (tanh((time_s - begin_s) / edge_s) - tanh((time_s - end_s) / edge_s));
}

}  // namespace stickslip::physics
