// SPDX-License-Identifier: Apache-2.0
// Phase and amplitude of the drive of a recording, by sample.
#pragma once

#include <vector>

#include "diagnosis/experiment.h"

namespace stickslip::diagnosis {

/// From the driving quantity (displacement of the base, force, or imposed motion, less its mean)
/// and its rate.
struct DrivePhase {
  std::vector<double> phase_rad;  ///< 0 to 2 pi, 0 at the crest
  std::vector<double> amplitude;  ///< in the unit of the driving quantity: m, or N
};
DrivePhase drive_phase_of(const Experiment& experiment);

struct WindowDrive {
  double frequency_hz = 0.0;
  double amplitude = 0.0;  ///< mean
};
WindowDrive drive_in(const DrivePhase& drive, const Window& window, double period_s);

/// True if the drive of a recording has a frequency, which changes little from window to window. A
/// move from point to point has none.
bool is_periodic(const DrivePhase& drive, const Experiment& experiment);

/// Frequency of the strongest line of the driving quantity, in the longest stretch without a gap
/// [Hz]; 0 where it is constant.
double drive_frequency_hz(const Experiment& experiment);

}  // namespace stickslip::diagnosis
