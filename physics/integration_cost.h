// SPDX-License-Identifier: Apache-2.0
// The integration steps that a motion takes, as far as they are known before it is integrated: by
// the fastest motion of the model.
#pragma once

#include <string>

#include "physics/model.h"

namespace stickslip::physics {

/// The fastest oscillation or decay of a model without its friction, which is integrated
/// implicitly.
struct FastestMotion {
  double rate_rad_s = 0.0;  ///< angular frequency, or rate of the decay; 0: imposed motion
  std::string parameter;    ///< path in the model file of what sets it; empty if nothing does
  double value = 0.0;       ///< of that parameter
};

/// Throws std::invalid_argument where inconsistencies_of(model) is not empty.
FastestMotion fastest_motion(const Model& model);

/// Steps of one integration, about five minutes of work.
inline constexpr double most_steps = 1.0e9;

/// Why an integration is refused: what it integrates ("2000 drive periods"), the steps that this
/// takes, the parameter at fault and what to do; empty if it takes at most `most`.
std::string wrong_with_steps(const Model& model, double steps, const std::string& integrated,
                             double most = most_steps);

/// Why a RigSimulator cannot follow the model over this time: it takes too many steps, or the model
/// moves faster than its shortest step. Empty if it can.
std::string wrong_with_simulation(const Model& model, double duration_s);

}  // namespace stickslip::physics
