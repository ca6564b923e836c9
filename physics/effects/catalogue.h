// The catalogue: every effect that the project knows.
#pragma once

#include <span>
#include <string_view>

#include "physics/effects/effect.h"

namespace stickslip::physics {

/// Every effect, in the order of the contract.
std::span<const Effect* const> catalogue();

/// The effect of that id; nullptr where there is none.
const Effect* find_effect(std::string_view id);

/// Whether `effect` could be what `model`, with the terms that it has, is lacking; a sensor effect
/// at that place.
bool can_be_missing(const Effect& effect, const Model& model, const Place& place = {});

}  // namespace stickslip::physics
