// SPDX-License-Identifier: Apache-2.0
// The largest Lyapunov exponent: the rate at which neighbouring orbits diverge.
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
  std::function<void(double share)> progress = {};  ///< share done, 0 to 1; may be empty
};

struct Lyapunov {
  double exponent_per_s = 0.0;
  double standard_error_per_s = 0.0;  ///< from the spread over 20 stretches of the run
  double per_period = 0.0;            ///< the same over one drive period
};

/// Two neighbouring orbits whose distance is renormalised every twentieth of a period (Benettin et
/// al., 1980). No derivative is needed, so sticking, lost contact and the set-valued law are
/// covered. Distances are in units of the spread of the orbit.
Lyapunov largest_exponent(const physics::Model& model, const Drive& drive,
                          const LyapunovOptions& options = {});

}  // namespace stickslip::dynamics
