#include "physics/declared_value.h"

#include "physics/catalogue.h"
#include "physics/number_text.h"

namespace stickslip::physics {

namespace {

// "cubic_stiffness" of "physics.cubic_stiffness.k3_n_m3"; nullptr for a path outside the terms.
const Effect* effect_of(std::string_view path) {
  constexpr std::string_view terms = "physics.";
  if (!path.starts_with(terms)) return nullptr;
  path.remove_prefix(terms.size());
  return find_effect(path.substr(0, path.find('.')));
}

const ParameterCard* card_of(std::string_view path) {
  const Effect* effect = effect_of(path);
  if (effect == nullptr) return nullptr;
  const std::string_view name = path.substr(path.rfind('.') + 1);
  for (const ParameterCard& card : effect->card().parameters) {
    if (card.name == name) return &card;
  }
  return nullptr;
}

bool is_of(std::string_view path, std::string_view table) { return path.starts_with(table); }

}  // namespace

std::vector<std::string> contradictable_numbers(const Model& model) {
  Model copy = model;
  std::vector<std::string> out;
  for (const NamedParameter& each : parameters_of(copy)) {
    if (is_of(each.path, "sensors.")) continue;
    if (each.parameter == &copy.friction.transition_speed_m_s && each.parameter->value == 0.0) {
      continue;
    }
    const ParameterCard* card = card_of(each.path);
    if (card != nullptr && card->fixed_default) continue;
    out.push_back(each.path);
  }
  return out;
}

bool is_signed(std::string_view path) {
  if (const ParameterCard* card = card_of(path)) return !card->positive;
  return path == "normal_load.slope_per_m";
}

Relation relation_of(std::string_view path) {
  if (const Effect* effect = effect_of(path)) return effect->card().relation;
  if (is_of(path, "friction.")) return Relation::friction_law;
  if (is_of(path, "normal_load.")) return Relation::normal_load;
  if (is_of(path, "load_cell.")) return Relation::load_cell;
  if (is_of(path, "sensors.")) return Relation::sensor;
  return Relation::force_balance;
}

std::string contradiction(std::string_view path, double declared, double found) {
  int digits = 3;
  while (digits < 17 && number_text(found, digits) == number_text(declared, digits)) ++digits;
  // A term's parameter is named with its effect.
  const std::size_t at = is_of(path, "physics.") ? sizeof("physics.") - 1 : path.rfind('.') + 1;
  return std::string(path.substr(at)) + " is " + number_text(found, digits) + ", not " +
         number_text(declared, digits);
}

}  // namespace stickslip::physics
