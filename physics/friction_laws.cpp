// SPDX-License-Identifier: Apache-2.0
#include "physics/friction_laws.h"

#include <algorithm>
#include <array>
#include <string>

namespace stickslip::physics {

const Effect& coulomb_law();
const Effect& state_variable_law();
const Effect& stribeck_law();
const Effect& dahl_law();
const Effect& lugre_law();
const Effect& bouc_wen_law();
const Effect& iwan_law();
const Effect& gms_law();
const Effect& rate_and_state_law();

std::span<const Effect* const> friction_laws() {
  static const std::array list = {
      &coulomb_law(),  &state_variable_law(), &stribeck_law(), &dahl_law(),          &lugre_law(),
      &bouc_wen_law(), &iwan_law(),           &gms_law(),      &rate_and_state_law()};
  return list;
}

const Effect* find_law(std::string_view id) {
  for (const Effect* law : friction_laws()) {
    if (law->card().id == id) return law;
  }
  return nullptr;
}

const Term* law_term(const Model& model) {
  const auto found = std::find_if(model.terms.begin(), model.terms.end(),
                                  [](const Term& term) { return term.law; });
  return found == model.terms.end() ? nullptr : &*found;
}

void settle_law(Model& model) {
  const Term* term = law_term(model);
  if (term == nullptr) return;
  const Effect* law = find_law(term->id);
  const bool is_state_variable = law == &state_variable_law();
  if (law != &coulomb_law() && !is_state_variable) return;
  const auto value = [term](const char* name) {
    const auto found = term->parameters.find(name);
    return found == term->parameters.end() ? Parameter{} : found->second;
  };
  model.friction = {is_state_variable ? FrictionLaw::state_variable : FrictionLaw::coulomb,
                    value("mu"), value("transition_speed_m_s"), value("rate_per_s")};
  model.terms.erase(model.terms.begin() + (term - model.terms.data()));
}

bool is_frictionless(const Model& model) {
  return model.friction.law == FrictionLaw::none && law_term(model) == nullptr;
}

Parameter friction_coefficient(const Model& model) {
  if (is_frictionless(model)) return {};
  const Term* term = law_term(model);
  if (term == nullptr) return model.friction.mu;
  const auto found = term->parameters.find("mu");
  return found == term->parameters.end() ? Parameter{} : found->second;
}

}  // namespace stickslip::physics
