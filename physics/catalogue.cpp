// SPDX-License-Identifier: Apache-2.0
#include "physics/catalogue.h"

#include <algorithm>
#include <array>
#include <tuple>
#include <vector>

#include "physics/formula_effect.h"
#include "physics/friction_laws.h"
#include "physics/rig.h"
#include "physics/spelling.h"

namespace stickslip::physics {

namespace {

std::vector<const Effect*> ordered(std::span<const Effect* const> list) {
  std::vector<const Effect*> effects(list.begin(), list.end());
  const auto rank = [](const Effect* effect) {
    const Card& card = effect->card();
    return std::tuple(card.tier, card.relation, card.id);
  };
  std::sort(effects.begin(), effects.end(),
            [rank](const Effect* a, const Effect* b) { return rank(a) < rank(b); });
  return effects;
}

}  // namespace

std::string_view name_of(Relation relation) {
  switch (relation) {
    case Relation::kinematics:
      return "kinematics";
    case Relation::force_balance:
      return "force_balance";
    case Relation::friction_law:
      return "friction_law";
    case Relation::normal_load:
      return "normal_load";
    case Relation::load_cell:
      return "load_cell";
    case Relation::sensor:
      return "sensor";
  }
  return "";
}

std::span<const Effect* const> catalogue() {
  static const std::vector<const Effect*> effects = ordered(effect_list());
  return effects;
}

const Effect* find_effect(std::string_view id) {
  for (const Effect* effect : catalogue()) {
    if (effect->card().id == id) return effect;
  }
  return nullptr;
}

const Effect* effect_of(const Term& term) {
  if (term.law) return find_law(term.id);
  return term.formula ? term.formula.get() : find_effect(term.id);
}

Term term_of(const Effect& effect, const Place& place) {
  Term term;
  term.id = effect.card().id;
  term.channel = place.channel;
  term.from = place.from;
  term.formula = effect.own_formula();
  term.law = effect.card().law;
  return term;
}

std::string nearest_effect(std::string_view id) {
  std::vector<std::string> ids;
  for (const Effect* effect : catalogue()) ids.emplace_back(effect->card().id);
  return nearest(id, ids);
}

bool has_own_characteristic(const Effect& effect, const Place& place) {
  if (!place.channel) return false;
  ReadingLaws<double> laws;
  const std::array<double, max_effect_parameters> zero{};
  effect.set_reading_law(laws, place, zero.data());
  return laws.of[index_of(*place.channel)].characteristic != nullptr;
}

bool is_in_law(const Effect& effect, const Model& model) {
  const Term* term = law_term(model);
  const Effect* law = term == nullptr ? nullptr : effect_of(*term);
  if (law == nullptr || effect.card().law) return false;
  const auto includes = law->card().includes;
  return effect.card().id == law->card().id ||
         std::find(includes.begin(), includes.end(), effect.card().id) != includes.end();
}

bool can_be_missing(const Effect& effect, const Model& model, const Place& place) {
  if (is_in_law(effect, model)) return false;
  if (place.channel && !effect.acts_on(place)) return false;
  if (model.terms.size() >= static_cast<std::size_t>(max_terms)) return false;
  int states = effect.state_count();
  Model amended = model;
  for (const Term& term : model.terms) {
    if (term.id == effect.card().id && term.law == effect.card().law &&
        term.channel == place.channel && term.from == place.from) {
      return false;
    }
    const Effect* present = effect_of(term);
    if (present == nullptr) continue;
    states += present->state_count();
    if (place.channel && term.channel == place.channel && has_own_characteristic(effect, place) &&
        has_own_characteristic(*present, place)) {
      return false;
    }
    present->amend(amended);
  }
  return states <= max_term_states && effect.can_be_missing_from(amended);
}

}  // namespace stickslip::physics
