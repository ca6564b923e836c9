// SPDX-License-Identifier: Apache-2.0
// The catalogue: every effect that was compiled in.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "physics/effect.h"

namespace stickslip::physics {

/// The effects of physics/effects/ in the order of their file names; generated, see effects.cmake.
std::span<const Effect* const> effect_list();

/// Every effect, ordered by tier, then by relation, then by id.
std::span<const Effect* const> catalogue();

/// The effect of that id; nullptr where there is none.
const Effect* find_effect(std::string_view id);

/// The effect of a term: its formula, or the one of its id; nullptr where there is none.
const Effect* effect_of(const Term& term);

/// A term of that effect, without parameters.
Term term_of(const Effect& effect, const Place& place);

/// The id that was probably meant by `id`; empty if none resembles it.
std::string nearest_effect(std::string_view id);

/// Most states that the terms of a model may have together.
inline constexpr int max_term_states = max_effect_states;

/// True if `model`, with its terms, can lack `effect` and has room for it; for a sensor effect at
/// that place.
bool can_be_missing(const Effect& effect, const Model& model, const Place& place = {});

/// True if the model's law of friction has the effect in it.
bool is_in_law(const Effect& effect, const Model& model);

/// True if the sensor effect has a characteristic of its own (Effect::distort) at that place. A
/// channel can have one of them.
bool has_own_characteristic(const Effect& effect, const Place& place);

}  // namespace stickslip::physics
