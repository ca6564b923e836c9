// SPDX-License-Identifier: Apache-2.0
#include "physics/declared_value.h"

#include <algorithm>
#include <array>
#include <optional>

#include "physics/catalogue.h"
#include "physics/friction_laws.h"
#include "physics/number_text.h"

namespace stickslip::physics {

namespace {

bool is_of(std::string_view path, std::string_view table) { return path.starts_with(table); }

// The law of "friction.mu", where it has a name; "cubic_stiffness" of
// "physics.cubic_stiffness.k3_n_m3"; nullptr for a path outside the terms.
const Effect* effect_of(std::string_view path, const Model& model) {
  if (is_of(path, "friction.")) {
    const Term* law = law_term(model);
    return law == nullptr ? nullptr : effect_of(*law);
  }
  constexpr std::string_view terms = "physics.";
  if (!path.starts_with(terms)) return nullptr;
  path.remove_prefix(terms.size());
  const std::string_view id = path.substr(0, path.find('.'));
  for (const Term& term : model.terms) {
    if (term.id == id) return effect_of(term);
  }
  return find_effect(id);
}

const ParameterCard* card_of(std::string_view path, const Model& model) {
  const Effect* effect = effect_of(path, model);
  if (effect == nullptr) return nullptr;
  const std::string_view name = path.substr(path.rfind('.') + 1);
  for (const ParameterCard& card : effect->card().parameters) {
    if (card.name == name) return &card;
  }
  return nullptr;
}

struct UnitOfSuffix {
  std::string_view suffix;
  std::string_view unit;
};

// Of the numbers of a model's own tables; the longer of two that fit comes first.
constexpr std::array<UnitOfSuffix, 11> units_of_suffixes{{{"_n_m3", "N/m3"},
                                                          {"_n_s_m", "N s/m"},
                                                          {"_n_m", "N/m"},
                                                          {"_m_s", "m/s"},
                                                          {"_per_s", "1/s"},
                                                          {"_per_m", "1/m"},
                                                          {"_kg", "kg"},
                                                          {"_hz", "Hz"},
                                                          {"_n", "N"},
                                                          {"_s", "s"},
                                                          {"_m", "m"}}};

// The channel in "sensors.displacement.offset" or "physics.sensor_offset.displacement.offset".
std::optional<Channel> channel_in(std::string_view path) {
  for (const Channel channel : all_channels) {
    const std::string part = std::string(".").append(info(channel).stem).append(".");
    if (path.find(part) != std::string_view::npos) return channel;
  }
  return std::nullopt;
}

}  // namespace

std::string unit_at(std::string_view unit, const Place& place) {
  constexpr std::string_view of_channel = "unit of the channel";
  if (unit.starts_with(of_channel) && place.channel) {
    return std::string(info(*place.channel).unit).append(unit.substr(of_channel.size()));
  }
  if (unit == "unit of this channel over that of the other" && place.channel && place.from) {
    const std::string_view here = info(*place.channel).unit;
    const std::string_view there = info(*place.from).unit;
    if (here == there) return "1";
    return std::string(here).append("/(").append(there).append(")");
  }
  return std::string(unit);
}

std::string unit_of(std::string_view path, const Model& model) {
  const std::optional<Channel> channel = channel_in(path);
  if (const ParameterCard* card = card_of(path, model)) return unit_at(card->unit, {channel, {}});
  if (path.ends_with(".offset") && channel) return std::string(info(*channel).unit);
  const auto* const found =
      std::find_if(units_of_suffixes.begin(), units_of_suffixes.end(),
                   [&](const UnitOfSuffix& each) { return path.ends_with(each.suffix); });
  return found == units_of_suffixes.end() ? "1" : std::string(found->unit);
}

std::vector<std::string> contradictable_numbers(const Model& model) {
  Model copy = model;
  std::vector<std::string> out;
  for (const NamedParameter& each : parameters_of(copy)) {
    if (is_of(each.path, "sensors.")) continue;
    if (each.parameter == &copy.friction.transition_speed_m_s && each.parameter->value == 0.0) {
      continue;
    }
    const ParameterCard* card = card_of(each.path, model);
    if (card != nullptr && card->fixed_default) continue;
    out.push_back(each.path);
  }
  return out;
}

bool is_signed(std::string_view path, const Model& model) {
  if (const ParameterCard* card = card_of(path, model)) return !card->positive;
  if (const auto instrument = instrument_parameter(path)) {
    return instrument->quantity != InstrumentQuantity::gain;
  }
  return path == "normal_load.slope_per_m";
}

Relation relation_of(std::string_view path, const Model& model) {
  if (const Effect* effect = effect_of(path, model)) return effect->card().relation;
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
