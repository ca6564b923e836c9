// SPDX-License-Identifier: Apache-2.0
// Cylindrical phase portraits, as in Figures 2 and 10 of the paper.
#pragma once

#include <string>
#include <vector>

#include "tools/figures/gnuplot.h"

namespace stickslip::figures {

/// A point of a trajectory under a periodic drive.
struct PhasePoint {
  double turn = 0.0;  ///< time in drive periods; the phase is its fraction
  double x = 0.0;
  double v = 0.0;
};

struct Labels {
  std::string displacement;  ///< with its unit
  std::string velocity;
};

/// Displacement along the radius (outward from an empty core), phase of the drive along the
/// circumference, velocity along the axis; time runs clockwise, seen from above. Two rings mark the
/// plane of zero velocity; all three axes have ticks.
Picture cylindrical_portrait(const std::vector<PhasePoint>& points, const Labels& labels,
                             const std::string& stem);

/// Velocity against phase near zero, `share` of its range to both sides: shows whether an arriving
/// mass sticks or overshoots.
Picture near_rest(const std::vector<PhasePoint>& points, const Labels& labels, double share,
                  const std::string& stem);

}  // namespace stickslip::figures
