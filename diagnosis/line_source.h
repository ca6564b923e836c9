// SPDX-License-Identifier: Apache-2.0
// The source of a tone in a recording, as far as its frequency shows it: mains, drive, another
// tone, or a rotating machine.
#pragma once

#include <string>
#include <vector>

#include "diagnosis/experiment.h"
#include "diagnosis/findings.h"

namespace stickslip::diagnosis {

/// Frequencies that a tone is compared with.
struct LineContext {
  double drive_hz = 0.0;              ///< of the strongest line of the drive; 0: no drive
  double sampling_hz = 0.0;           ///< beyond half of it the mains appear elsewhere
  std::vector<double> other_hz = {};  ///< of lower tones
};

/// A sentence about a tone of `frequency_hz`, known to `tolerance_hz`: which of those frequencies
/// it is a multiple of, or else the speed of a shaft that would cause it.
std::string source_of_line(double frequency_hz, double tolerance_hz, const LineContext& context);

/// Appends that sentence to the statement of every finding that is a tone.
void add_line_sources(const Experiment& experiment, std::vector<Finding>& findings);

}  // namespace stickslip::diagnosis
