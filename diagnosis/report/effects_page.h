// SPDX-License-Identifier: Apache-2.0
// The catalogue of effects for people, made from its entries: docs/effects.md and
// `stickslip effects`.
#pragma once

#include <cstddef>
#include <string>

#include "physics/effect.h"

namespace stickslip::report {

/// One line per effect, its id and its name; likewise the laws of friction.
std::string effects_list();

/// Formula, parameters, place, rivals and literature of one effect or law, wrapped to `columns`.
std::string effect_text(const physics::Effect& effect, std::size_t columns);

/// The page docs/effects.md, which shows the pictures effects/ID.svg.
std::string effects_page();

}  // namespace stickslip::report
