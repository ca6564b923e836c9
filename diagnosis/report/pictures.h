// The pictures of a report, each with the words below it that say what it shows and what to look
// at.
#pragma once

#include <string>

#include "diagnosis/diagnosis.h"

namespace stickslip::diagnosis {

/// The recording beside both predictions, and what each leaves, over a stretch that nothing was
/// fitted to. Empty without evidence.
std::string stretch_figures(const Diagnosis& diagnosis);

/// What is left over by channel and time, in phase space, by frequency, and by how the rig was
/// driven. Empty without evidence.
std::string residual_figures(const Diagnosis& diagnosis);

/// The law that was fitted, with its interval.
std::string shape_figures(const Finding& finding);

/// How far calibrated parameters went from their declared values.
std::string calibration_figure(const Diagnosis& diagnosis);

}  // namespace stickslip::diagnosis
