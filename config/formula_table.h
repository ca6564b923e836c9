// SPDX-License-Identifier: Apache-2.0
// Formulas of one's own in [[physics]] and [[candidate]] tables.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/value.h"
#include "physics/formula_effect.h"
#include "physics/model.h"

namespace stickslip::config {

/// True for a table with these keys, one of which only formulas have: it is no effect of the
/// catalogue.
bool states_formula(const std::vector<std::string>& keys);

/// The term of a table whose keys are valid. Throws physics::FormulaRejection.
physics::Term formula_term(const Value& table, const physics::FormulaSurroundings& surroundings);

/// The keys of a formula that the table has: "force", "reading.velocity".
std::vector<std::string> formula_keys_in(const Value& table);

/// { c1 = { value = 0.1, sigma = 0.01, unit = "N s/m" } }, and likewise for states, as TOML.
std::string parameters_text(const physics::Term& term);
std::string states_text(const physics::FormulaDeclaration& declaration);

}  // namespace stickslip::config
