// SPDX-License-Identifier: Apache-2.0
// Fits from several values of the declared numbers, the best of which go on.
#pragma once

#include <cstdint>
#include <vector>

#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

/// The hypothesis with the numbers of all instruments exact, as they are declared.
Hypothesis holding_instruments(const Hypothesis& hypothesis);

/// Fits `z` with `options`, after fits of the beginnings of the windows, which grow: over a short
/// time even a start that is far away follows the motion.
Fit fit_growing_beginnings(const Task& task, const Hypothesis& hypothesis,
                           const std::vector<double>& z, const std::vector<WindowState>& states,
                           const FitOptions& options);

/// Fits `z` with `options` from the best of several starts: from `z` itself, and from others within
/// the declared uncertainty of the model's numbers. Those of instruments, which are known best,
/// start from `z`. Starts race over the beginnings of the windows, which grow as starts drop out.
///
/// A contact that sticks rings at a frequency that follows from the numbers of friction. Over a
/// window whose number of cycles they leave uncertain, the cost has a minimum for each number; over
/// its beginning these are one.
Fit fit_from_many_starts(const Task& task, const Hypothesis& hypothesis,
                         const std::vector<double>& z, const std::vector<WindowState>& states,
                         std::uint64_t seed, const FitOptions& options);

}  // namespace stickslip::diagnosis
