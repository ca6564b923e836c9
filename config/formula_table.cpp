// SPDX-License-Identifier: Apache-2.0
#include "config/formula_table.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>
#include <vector>

#include "config/key_binding.h"
#include "config/key_tables.h"
#include "config/toml_text.h"

namespace stickslip::config {

namespace {

using physics::FormulaDeclaration;
using physics::FormulaQuantity;

constexpr std::array quantities = {FormulaQuantity::force, FormulaQuantity::friction,
                                   FormulaQuantity::load, FormulaQuantity::reading};

std::string braced(const std::string& entries) {
  return entries.empty() ? "{}" : "{ " + entries + " }";
}

// `out` with one more entry of an inline table.
void add_entry(std::string& out, std::string_view key, std::string_view value) {
  if (!out.empty()) out += ", ";
  out.append(key).append(" = ").append(value);
}

std::string parameter_entry(const physics::Parameter& value, const std::string& unit) {
  if (value.sigma == 0.0 && unit.empty()) return toml_number(value.value);
  std::string entries;
  add_entry(entries, "value", toml_number(value.value));
  if (value.sigma != 0.0) add_entry(entries, "sigma", toml_number(value.sigma));
  if (!unit.empty()) add_entry(entries, "unit", toml_string(unit));
  return braced(entries);
}

}  // namespace

bool states_formula(const std::vector<std::string>& keys) {
  return std::any_of(keys.begin(), keys.end(), [](const std::string& name) {
    const bool of_quantity =
        std::any_of(quantities.begin(), quantities.end(),
                    [&](FormulaQuantity each) { return physics::name_of(each) == name; });
    return of_quantity || name == "relation" || name == "parameters" || name == "states";
  });
}

std::vector<std::string> formula_keys_in(const Value& table) {
  std::vector<std::string> out;
  for (const FormulaQuantity each : quantities) {
    std::string name(physics::name_of(each));
    const auto found = table.at(name);
    if (!found) continue;
    if (each != FormulaQuantity::reading) {
      out.push_back(std::move(name));
      continue;
    }
    for (const auto& entry : found->entries()) out.push_back(name + '.' + entry.first);
  }
  return out;
}

physics::Term formula_term(const Value& table, const physics::FormulaSurroundings& surroundings) {
  FormulaDeclaration declaration;
  read_keys(keys_of<FormulaDeclaration>(), table, &declaration);
  physics::Term term;
  term.id = declaration.id;
  term.channel = declaration.channel;
  if (const auto parameters = table.at("parameters")) {
    for (const auto& [name, each] : parameters->entries()) {
      term.parameters.emplace(name, each.parameter());
    }
  }
  term.formula =
      physics::FormulaEffect::make(std::move(declaration), term.parameters, surroundings);
  return term;
}

std::string parameters_text(const physics::Term& term) {
  std::string entries;
  for (const physics::FormulaParameter& each : term.formula->declaration().parameters) {
    const auto found = term.parameters.find(each.name);
    if (found == term.parameters.end()) continue;
    add_entry(entries, each.name, parameter_entry(found->second, each.unit));
  }
  return braced(entries);
}

std::string states_text(const FormulaDeclaration& declaration) {
  std::string entries;
  for (const physics::FormulaState& each : declaration.states) {
    std::string inner;
    add_entry(inner, "rate", toml_string(each.rate));
    if (!each.within.empty()) add_entry(inner, "within", toml_string(each.within));
    if (!each.unit.empty()) add_entry(inner, "unit", toml_string(each.unit));
    if (each.size != 0.0) add_entry(inner, "size", toml_number(each.size));
    add_entry(entries, each.name, braced(inner));
  }
  return braced(entries);
}

}  // namespace stickslip::config
