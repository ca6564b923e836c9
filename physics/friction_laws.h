// SPDX-License-Identifier: Apache-2.0
// The laws of friction by name, those of [friction] law = "..." but for "none".
#pragma once

#include <span>
#include <string_view>

#include "physics/effect.h"

namespace stickslip::physics {

/// Every law (physics/laws/), the simplest first.
std::span<const Effect* const> friction_laws();

/// The law of that id; nullptr where there is none.
const Effect* find_law(std::string_view id);

/// The law that a model has by name; nullptr where Friction::law says all.
const Term* law_term(const Model& model);

/// A law as a model file declares it: those that Friction::law has become part of `friction`.
void settle_law(Model& model);

/// True if neither Friction::law nor a name declares a law.
bool is_frictionless(const Model& model);

/// The coefficient of friction of the model's law, 0 without friction.
Parameter friction_coefficient(const Model& model);

}  // namespace stickslip::physics
