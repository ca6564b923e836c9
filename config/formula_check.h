// SPDX-License-Identifier: Apache-2.0
// Checks of formulas in a parsed TOML file, with their place in it.
#pragma once

#include <toml++/toml.h>

#include <functional>
#include <string>

#include "config/toml_nodes.h"
#include "physics/formula_effect.h"

namespace stickslip::config {

/// Reports a problem of a formula: its place, its key within the table, and why.
using FormulaReport =
    std::function<void(const Place&, const std::string& key, const std::string& message)>;

/// Checks the whole of a table whose keys are known and of the right types.
void check_formula(const toml::table& table, const physics::FormulaSurroundings& surroundings,
                   const FormulaReport& report);

/// Checks the values of `parameters` and of `states`.
void check_named_parameters(const toml::node& node, const FormulaReport& report);
void check_named_states(const toml::node& node, const FormulaReport& report);

}  // namespace stickslip::config
