// How often a recording like this one would be accused although nothing is missing: the calibrated
// declared model is recorded again and again under the same drive, with the same noise, and
// diagnosed (a parametric bootstrap).
#pragma once

#include <vector>

#include "diagnosis/diagnosis.h"

namespace stickslip::diagnosis {

/// `result` is the diagnosis of `recordings` against `declared`. Deterministic for a seed.
FalseAlarms false_alarms(const std::vector<protocol::Recording>& recordings,
                         const physics::Model& declared, const Diagnosis& result, std::size_t count,
                         const Options& options);

}  // namespace stickslip::diagnosis
