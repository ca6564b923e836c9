// The largest Lyapunov exponent: how fast neighbouring motions part.
#pragma once

#include <functional>

#include "tools/dynamics/orbit.h"

namespace stickslip::dynamics {

struct LyapunovOptions {
  int periods = 2000;        ///< drive periods over which the exponent is averaged
  int transient = 200;       ///< drive periods before that
  int steps_per_period = 0;  ///< 0: enough_steps
  double x_m = 0.0;          ///< start
  double v_m_s = 0.0;
  std::function<void(double share)> progress = {};  ///< told how much is done, 0 to 1; may be empty
};

struct Lyapunov {
  double exponent_per_s = 0.0;
  double standard_error_per_s = 0.0;  ///< from the spread over 20 stretches of the run
  double per_period = 0.0;            ///< the same over one drive period
};

/// By two neighbouring orbits whose distance is brought back to its size every twentieth of a
/// period (Benettin and others, 1980). It needs no derivative, so it holds across sticking, lost
/// contact and the set-valued law. Distances are measured in units of the orbit's own spread.
Lyapunov largest_exponent(const physics::Model& model, const Drive& drive,
                          const LyapunovOptions& options = {});

}  // namespace stickslip::dynamics
