// SPDX-License-Identifier: Apache-2.0
// Correspondence of the states of two filters, for an observer that goes on from another one's
// state with a changed model of the same rig.
#pragma once

#include <array>

#include "observer/layout.h"
#include "physics/rig.h"

namespace stickslip::observer {

/// For each state of a filter the state of the earlier one that is the same quantity, or one of
/// these.
using Correspondence = std::array<int, max_states>;
inline constexpr int no_correspondence = -1;
inline constexpr int known_zero = -2;  ///< a rate of what the earlier model had constant

/// One side of the comparison.
struct FilterStates {
  const Layout& layout;
  const physics::Rig& rig;
};

/// States correspond where they have the same meaning and unit in both models: motion, drive,
/// friction and theta; the contact's own state and the states of [[physics]] terms of the same
/// effect; mu, gamma and the load; chains of filters of the same orders, delays of as many
/// sections, hum and offset of the same channel. The filters of a load that is constant are at rest
/// with it. None do where the excitations differ. No allocation.
Correspondence corresponding_states(const FilterStates& now, const FilterStates& before);

}  // namespace stickslip::observer
