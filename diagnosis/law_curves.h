// SPDX-License-Identifier: Apache-2.0
// A fitted law of friction as the literature draws it: the contact alone, under motions of the size
// of the recorded ones.
#pragma once

#include <vector>

#include "diagnosis/experiment.h"
#include "physics/model.h"

namespace stickslip::diagnosis {

struct LawCurves {
  /// One cycle of a sinusoidal motion.
  std::vector<double> displacement_m, velocity_m_s, force_n;
  /// A sinusoid of velocity that stays positive: friction lags behind the velocity.
  std::vector<double> lag_velocity_m_s, lag_force_n;
  /// Largest friction before a mass slips under a growing force; empty for an imposed motion.
  std::vector<double> loading_rate_n_s, break_away_n;
};

/// Measured friction over a stretch of the recording.
struct RecordedFriction {
  std::vector<double> displacement_m, velocity_m_s, force_n;
};

/// One cycle of a sinusoidal motion of the largest recorded deflection and speed.
struct FrictionCycle {
  std::vector<double> displacement_m, velocity_m_s, force_n;
};

/// Of the contact alone, with every term of the model that changes its friction.
FrictionCycle friction_cycle(const physics::Model& model, const Experiment& experiment);

LawCurves law_curves(const physics::Model& fitted, const Experiment& experiment);

/// Empty where the friction force was not recorded.
RecordedFriction recorded_friction(const Experiment& experiment);

}  // namespace stickslip::diagnosis
