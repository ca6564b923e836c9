// SPDX-License-Identifier: Apache-2.0
// Numbers that a model states and a recording contradicts: the effect of the catalogue that adds no
// term to the equations. It changes a number that is in them.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "physics/effect.h"
#include "physics/model.h"

namespace stickslip::physics {

/// Its entry in the catalogue. No `[[physics]]` table can hold it: a model has the right number in
/// its place instead.
const Effect& declared_value();

/// Paths of the numbers of `model` that a recording may contradict: those of its laws, and the
/// estimated parameters of its terms. Errors of sensors are effects of their own, and a transition
/// speed of 0 states a law and no number.
std::vector<std::string> contradictable_numbers(const Model& model);

/// True if the number at that path of `model` may have either sign.
bool is_signed(std::string_view path, const Model& model);

/// The relation that the number at that path enters.
Relation relation_of(std::string_view path, const Model& model);

/// A unit on an effect's card, with the place's channel for "unit of the channel".
std::string unit_at(std::string_view unit, const Place& place);

/// Unit of the number at that path, as the suffix of its name or its place states it: "kg", "N/m3",
/// "1" for a ratio; that of the channel for an offset.
std::string unit_of(std::string_view path, const Model& model);

/// "damping_ratio is 0.06, not 0.02": with as many digits as differ between them. `path` as in
/// parameters_of().
std::string contradiction(std::string_view path, double declared, double found);

}  // namespace stickslip::physics
