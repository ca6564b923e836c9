// SPDX-License-Identifier: Apache-2.0
// The figures of a report, each with its caption.
#pragma once

#include <string>

#include "diagnosis/diagnosis.h"

namespace stickslip::report {

/// The recording with both predictions, and the residuals of each, over a held-out stretch. Empty
/// without evidence.
std::string stretch_figures(const diagnosis::Diagnosis& diagnosis);

/// Residuals by channel and time, in phase space, by frequency and by excitation. Empty without
/// evidence.
std::string residual_figures(const diagnosis::Diagnosis& diagnosis);

/// One curve of an effect as a plot; `name` is the legend of its line, empty: none.
std::string curve_svg(const diagnosis::Curve& curve, const std::string& name);

/// The fitted law with its interval.
std::string shape_figures(const diagnosis::Finding& finding);

/// Friction over velocity and displacement. Empty without a finding of friction.
std::string friction_figures(const diagnosis::Diagnosis& diagnosis);

/// Shifts of the calibrated parameters from their declared values.
std::string calibration_figure(const diagnosis::Diagnosis& diagnosis);

}  // namespace stickslip::report
