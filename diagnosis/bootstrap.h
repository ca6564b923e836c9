// SPDX-License-Identifier: Apache-2.0
// Rate of false alarms on recordings like the given one, by a parametric bootstrap: the calibrated
// declared model is simulated repeatedly under the same drive with the same noise, and diagnosed.
#pragma once

#include <vector>

#include "diagnosis/diagnosis.h"

namespace stickslip::diagnosis {

/// `result` is the diagnosis of `recordings` against `declared`. Deterministic for a seed.
FalseAlarms false_alarms(const std::vector<protocol::Recording>& recordings,
                         const physics::Model& declared, const Diagnosis& result, std::size_t count,
                         const Options& options);

}  // namespace stickslip::diagnosis
