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
  static const std::array effects = {
      // of the contract
      &dry_friction(), &friction_memory(), &stribeck(), &dwell_strengthening(),
      &contact_compliance(), &load_dependent_mu(), &asymmetric_friction(), &position_dependent_mu(),
      &friction_drift(), &quadratic_drag(), &cubic_stiffness(), &hysteresis(), &end_stop(),
      &bias_force(), &ambient_vibration(), &second_mode(), &wedge_load(), &load_cell_resonance(),
      &differentiator_lag(), &channel_delay(), &gain_error(), &crosstalk(), &clipping(),
      &mains_hum(), &sensor_drift(),
      // physics that the contract does not list
      &quadratic_stiffness(), &position_dependent_damping(), &contact_viscosity(),
      &logarithmic_friction(), &periodic_friction(), &load_curvature(), &load_vibration(),
      &quintic_stiffness(), &rate_and_state(), &load_history(), &bridge_nonlinearity(),
      &load_episode(), &friction_episode(), &force_episode(),
      // shapes
      &force_over_displacement(), &force_over_velocity(), &force_over_time(),
      &friction_over_displacement(), &friction_over_velocity(), &friction_over_time(),
      &friction_over_load(), &load_over_displacement(), &load_over_time()};
  return effects;
}

const Effect* find_effect(std::string_view id) {
  for (const Effect* effect : catalogue()) {
    if (effect->card().id == id) return effect;
  }
  return nullptr;
}

bool can_be_missing(const Effect& effect, const Model& model, const Place& place) {
  if (place.channel && !effect.acts_on(place)) return false;
  Model seen = model;
  for (const Term& term : model.terms) {
    if (term.id == effect.card().id && term.channel == place.channel && term.from == place.from) {
      return false;
    }
    if (const Effect* present = find_effect(term.id)) present->mark(seen);
  }
  return effect.can_be_missing_from(seen);
}

}  // namespace stickslip::physics
