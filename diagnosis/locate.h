// Where a mismatch shows: which channel, when, at which deflections, in which band.
#pragma once

#include "diagnosis/diagnosis.h"
#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

/// Looks at the residuals of `fitted` over the windows of `task`. `excess` is what chi-squared per
/// sample must exceed for a window to count as one in which the model fails.
Location locate(const Task& task, const Hypothesis& hypothesis, const Fit& fitted,
                physics::Relation relation, double excess);

}  // namespace stickslip::diagnosis
