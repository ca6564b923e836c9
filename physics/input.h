// SPDX-License-Identifier: Apache-2.0
// Excitation of a rig.
#pragma once

namespace stickslip::physics {

/// The excitation of a rig at one instant; only values that the model's excitation and laws use are
/// read.
struct Input {
  double base_displacement_m = 0.0;
  double base_acceleration_m_s2 = 0.0;
  double drive_force_n = 0.0;
  double displacement_m = 0.0;  ///< imposed motion only
  double velocity_m_s = 0.0;    ///< imposed motion only
  double normal_load_n = 0.0;   ///< normal-load law "measured" only
};

/// Linear interpolation from `a` (fraction 0) to `b` (fraction 1).
Input between(const Input& a, const Input& b, double fraction);

}  // namespace stickslip::physics
