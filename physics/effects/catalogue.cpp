#include "physics/effects/catalogue.h"

#include <array>

#include "physics/effects/entries.h"

namespace stickslip::physics {

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
  static const std::array effects = {&dry_friction(),
                                     &friction_memory(),
                                     &stribeck(),
                                     &contact_compliance(),
                                     &load_dependent_mu(),
                                     &asymmetric_friction(),
                                     &position_dependent_mu(),
                                     &friction_drift(),
                                     &quadratic_drag(),
                                     &cubic_stiffness(),
                                     &hysteresis(),
                                     &bias_force(),
                                     &wedge_load()};
  return effects;
}

const Effect* find_effect(std::string_view id) {
  for (const Effect* effect : catalogue()) {
    if (effect->card().id == id) return effect;
  }
  return nullptr;
}

bool can_be_missing(const Effect& effect, const Model& model) {
  Model seen = model;
  for (const Term& term : model.terms) {
    if (term.id == effect.card().id) return false;
    if (const Effect* present = find_effect(term.id)) present->mark(seen);
  }
  return effect.can_be_missing_from(seen);
}

}  // namespace stickslip::physics
