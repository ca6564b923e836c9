// SPDX-License-Identifier: Apache-2.0
// An orbit in points and numbers: Poincaré section, trajectory, ranges, share of lost contact, and
// overshoot of the plane of zero velocity.
#pragma once

#include <functional>
#include <vector>

#include "tools/dynamics/orbit.h"

namespace stickslip::dynamics {

struct PortraitOptions {
  int transient = 100;       ///< drive periods discarded
  int periods = 1000;        ///< drive periods evaluated
  int steps_per_period = 0;  ///< 0: enough_steps
  double phase = 0.0;        ///< of the section, in turns of the drive [0, 1)
  double x_m = 0.0;          ///< start
  double v_m_s = 0.0;
  std::function<void(double share)> progress = {};  ///< share done, 0 to 1; may be empty
};

struct Range {
  double low = 0.0;
  double high = 0.0;
};

/// The points of the orbit at one phase of the drive, one per period. Integrated by Flow if it can
/// follow the model and no number of steps is requested, else by Orbit.
std::vector<Point> poincare_section(const physics::Model& model, const Drive& drive,
                                    const PortraitOptions& options = {});

/// Every `stride`-th step of the orbit.
std::vector<Point> trajectory(const physics::Model& model, const Drive& drive,
                              const PortraitOptions& options, int stride);

struct Portrait {
  Range displacement_m;
  Range velocity_m_s;
  Range normal_load_n;
  double contact_lost = 0.0;       ///< share of the time without normal load
  double negative_friction = 0.0;  ///< share of the time at theta and velocity of opposite sign
  double sticking = 0.0;           ///< share of the time at slip velocity exactly 0
  /// Overshoot of the plane of zero velocity. An arrival is a passage of the velocity through 0 (or
  /// a stop at 0) at which Coulomb friction could hold the mass. The largest velocity beyond 0
  /// until friction could no longer hold it is measured, relative to the range of the velocity.
  /// Coulomb friction stops the mass: 0. `overshoot` is the mean over all arrivals.
  double overshoot = 0.0;
  int arrivals = 0;
};
Portrait portrait(const physics::Model& model, const Drive& drive,
                  const PortraitOptions& options = {});

}  // namespace stickslip::dynamics
