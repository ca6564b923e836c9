// SPDX-License-Identifier: Apache-2.0
// Score test of declared numbers: what freeing each would gain, to first order. One Jacobian serves
// all of them.
#pragma once

#include <span>
#include <vector>

#include "diagnosis/fitted_candidate.h"
#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

/// Decrease of the cost of `base` by freeing each of the `numbers` by itself, beside the unknowns
/// of the base and the window states, where the cost is quadratic. `states`: of the windows of
/// `task`.
std::vector<double> gains_of_numbers(const Task& task, const FittedCandidate& base,
                                     const std::vector<WindowState>& states,
                                     std::span<const CandidateEffect> numbers);

}  // namespace stickslip::diagnosis
