// The paper's cylindrical phase portraits: Figures 2 and 10.
#pragma once

#include <string>
#include <vector>

#include "tools/figures/gnuplot.h"

namespace stickslip::figures {

/// A point of a trajectory under a periodic drive.
struct PhasePoint {
  double turn = 0.0;  ///< drive periods since some moment; the phase is its fraction
  double x = 0.0;
  double v = 0.0;
};

struct Labels {
  std::string displacement;  ///< with its unit
  std::string velocity;
};

/// Displacement along the radius (outward from a free middle, that the smallest one does not meet),
/// phase of the drive along the circumference, velocity along the axis; the flow is clockwise, seen
/// from above. Two rings mark the plane of zero velocity.
Picture cylindrical_portrait(const std::vector<PhasePoint>& points, const Labels& labels,
                             const std::string& stem);

/// Velocity against phase near zero, `share` of its range to both sides: where a mass that arrives
/// at rest stays, or goes beyond.
Picture near_rest(const std::vector<PhasePoint>& points, const Labels& labels, double share,
                  const std::string& stem);

}  // namespace stickslip::figures
