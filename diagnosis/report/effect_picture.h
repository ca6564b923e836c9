// SPDX-License-Identifier: Apache-2.0
// The picture of an effect in the catalogue's page.
#pragma once

#include <string>

#include "physics/effect.h"

namespace stickslip::report {

/// An effect as a report draws it, with the example of its card on a bench like ours: its law, or
/// where it has none, a reading with and without it. A whole SVG file; empty without an example.
/// Throws std::invalid_argument if the example does not fit the card.
std::string effect_picture(const physics::Effect& effect);

}  // namespace stickslip::report
