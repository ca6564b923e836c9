// SPDX-License-Identifier: Apache-2.0
// Friction as recorded, as the declared model has it, and as the findings mend it, for a report.
#pragma once

#include <vector>

#include "diagnosis/fitted_candidate.h"
#include "diagnosis/law_curves.h"
#include "diagnosis/shape.h"

namespace stickslip::diagnosis {

/// One cycle of a sinusoidal motion of the recorded size, under the mean load, of both models.
struct FrictionPicture {
  RecordedFriction recorded;  ///< empty where the friction force was not recorded
  FrictionCycle declared;
  FrictionCycle mended;
  /// 95 % interval of the mended friction at each point, from the covariance of all numbers that it
  /// depends on; empty where unknown.
  std::vector<double> low_n, high_n;
};

FrictionPicture friction_picture(const FittedCandidate& declared, const FittedCandidate& mended,
                                 const Experiment& experiment);

}  // namespace stickslip::diagnosis
