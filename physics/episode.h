// SPDX-License-Identifier: Apache-2.0
// A time interval with smooth edges, so that a fit can adjust them.
#pragma once

#include <cmath>

#include "physics/effect.h"

namespace stickslip::physics {

/// Parameters of an effect that acts for a limited time. Starting values are accurate to about a
/// second; by default the effect lasts for the whole recording.
inline constexpr ParameterCard begin_parameter{.name = "begin_s",
                                               .unit = "s",
                                               .meaning = "start, from the start of the recording",
                                               .low = 0.0,
                                               .high = 100000.0,
                                               .positive = false,
                                               .fixed_default = 0.0,
                                               .estimated = true,
                                               .start_sigma = 1.0};
inline constexpr ParameterCard end_parameter{.name = "end_s",
                                             .unit = "s",
                                             .meaning = "end, from the start of the recording",
                                             .low = 0.0,
                                             .high = 100000.0,
                                             .positive = false,
                                             .fixed_default = 1.0e5,
                                             .estimated = true,
                                             .start_sigma = 1.0};

/// 1 between `begin_s` and `end_s`, 0 before and after, with edges of a few hundredths of a second.
template <class T>
T during(double time_s, const T& begin_s, const T& end_s) {
  using std::tanh;
  constexpr double edge_s = 0.03;
  return 0.5 * (tanh((time_s - begin_s) / edge_s) - tanh((time_s - end_s) / edge_s));
}

}  // namespace stickslip::physics
