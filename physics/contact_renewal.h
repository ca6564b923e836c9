// SPDX-License-Identifier: Apache-2.0
// Renewal of contacts by slip, which erases their history.
#pragma once

namespace stickslip::physics {

/// Rate at which the history variable decays at that slip speed if contacts are renewed over
/// `length_m` of slip; limited to what an integration step, and any sensor, can resolve.
template <class T>
T decay_per_s(const T& history, const T& speed_m_s, const T& length_m) {
  constexpr double fastest_per_s = 1000.0;
  return history * speed_m_s / (length_m + speed_m_s / fastest_per_s);
}

}  // namespace stickslip::physics
