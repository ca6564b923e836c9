// Predicted readings, corrected for the part of their residuals that the noise of the base's own
// channel explains.
#pragma once

#include <span>
#include <vector>

#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

/// By window of the task, from these parameters and states. Where the base is noisy, its most
/// probable error in each window, given the residuals, is removed.
std::vector<Readings> corrected_readings(const Task& task, const FittedHypothesis& fitted);

}  // namespace stickslip::diagnosis
