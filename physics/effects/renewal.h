// Slip renews the contacts, and with them what they remember.
#pragma once

namespace stickslip::physics {

/// What of `memory` is forgotten each second at that slip speed, if `length_m` of slip renew the
/// contacts; no faster than a step of the integration can follow, which no sensor resolves either.
template <class T>
T forgotten_per_s(const T& memory, const T& speed_m_s, const T& length_m) {
  constexpr double fastest_per_s = 1000.0;
  return memory * speed_m_s / (length_m + speed_m_s / fastest_per_s);
}

}  // namespace stickslip::physics
