// Where in its cycle the drive of a recording is at every sample, and how large it is there.
#pragma once

#include <vector>

#include "diagnosis/experiment.h"

namespace stickslip::diagnosis {

/// From the value of what drives the rig (the base's displacement, the force, or the imposed
/// motion, less its mean) and its rate, by sample.
struct DrivePhase {
  std::vector<double> phase_rad;  ///< 0 to 2 pi, 0 at the crest
  std::vector<double> amplitude;  ///< in the unit of what drives the rig: m, N for a force
};
DrivePhase drive_phase_of(const Experiment& experiment);

}  // namespace stickslip::diagnosis
