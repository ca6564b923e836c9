// SPDX-License-Identifier: Apache-2.0
// Keys of a model file.
#include <array>

#include "config/friction_keys.h"
#include "config/key_binding.h"

namespace stickslip::config {

namespace {

constexpr std::string_view moving = "oscillator.excitation=base|force";

// Behind the law of friction, which is the first of the terms.
void read_terms(physics::Model& model, std::size_t /*channel*/, const Value& value) {
  std::vector<physics::Term> terms;
  Reading<std::vector<physics::Term>>::read(terms, value);
  model.terms.insert(model.terms.end(), terms.begin(), terms.end());
}

constexpr std::array model_table = {
    schema_key<physics::Model>(),
    bound<&physics::Model::dimensionless>(
        Key{.path = "dimensionless",
            .sentence = "true: the equations are nondimensional, so every unit of this file is 1, "
                        "and results name no units."}),
    bound<&physics::Model::oscillator, &physics::Oscillator::excitation>(
        Key{.path = "oscillator.excitation",
            .sentence = "Excitation: base motion, a force on the mass, or imposed, where the "
                        "recorded motion is used and [oscillator] has no other keys.",
            .need = Need::always}),
    bound<&physics::Model::oscillator, &physics::Oscillator::mass_kg>(
        Key{.path = "oscillator.mass_kg",
            .unit = "kg",
            .sentence = "Mass on the spring.",
            .need = Need::always,
            .when = moving,
            .only_then = true,
            .low = 0,
            .above_low = true}),
    bound<&physics::Model::oscillator, &physics::Oscillator::natural_frequency_hz>(
        Key{.path = "oscillator.natural_frequency_hz",
            .unit = "Hz",
            .sentence = "Natural frequency without friction; alternative: stiffness_n_m.",
            .when = moving,
            .only_then = true,
            .low = 0,
            .above_low = true}),
    bound<&physics::Model::oscillator, &physics::Oscillator::stiffness_n_m>(
        Key{.path = "oscillator.stiffness_n_m",
            .unit = "N/m",
            .sentence = "Stiffness of the spring, 0: none; alternative: natural_frequency_hz.",
            .when = moving,
            .only_then = true,
            .low = 0}),
    bound<&physics::Model::oscillator, &physics::Oscillator::damping_ratio>(
        Key{.path = "oscillator.damping_ratio",
            .unit = "1",
            .sentence = "Damping ratio of mass and spring; alternative: damping_n_s_m.",
            .when = moving,
            .only_then = true,
            .low = 0}),
    bound<&physics::Model::oscillator, &physics::Oscillator::damping_n_s_m>(
        Key{.path = "oscillator.damping_n_s_m",
            .unit = "N s/m",
            .sentence = "Viscous damping; alternative: damping_ratio.",
            .when = moving,
            .only_then = true,
            .low = 0}),
    bound<&physics::Model::oscillator, &physics::Oscillator::two_well,
          &physics::TwoWell::linear_n_m>(
        Key{.path = "oscillator.two_well.linear_n_m",
            .unit = "N/m",
            .sentence =
                "Magnets: the restoring force is -linear_n_m x + cubic_n_m3 x^3 instead of k x.",
            .need = Need::in_table,
            .when = moving,
            .only_then = true,
            .low = 0,
            .above_low = true}),
    bound<&physics::Model::oscillator, &physics::Oscillator::two_well,
          &physics::TwoWell::cubic_n_m3>(
        Key{.path = "oscillator.two_well.cubic_n_m3",
            .unit = "N/m^3",
            .sentence = "Magnets: cubic part of the restoring force.",
            .need = Need::in_table,
            .when = moving,
            .only_then = true,
            .low = 0,
            .above_low = true}),
    bound<&physics::Model::normal_load, &physics::NormalLoad::law>(
        Key{.path = "normal_load.law",
            .sentence = "Law of the normal load: N = load_n, N = max(0, load_n (1 + slope_per_m "
                        "x)), or the recorded channel. Without [normal_load]: N = 1 N.",
            .need = Need::in_table}),
    bound<&physics::Model::normal_load, &physics::NormalLoad::load_n>(
        Key{.path = "normal_load.load_n",
            .unit = "N",
            .sentence = "Normal load at x = 0, summed over both pads.",
            .need = Need::in_table,
            .when = "normal_load.law=constant|wedge",
            .only_then = true,
            .low = 0}),
    bound<&physics::Model::normal_load, &physics::NormalLoad::slope_per_m>(
        Key{.path = "normal_load.slope_per_m",
            .unit = "1/m",
            .sentence = "Relative change of the normal load with deflection.",
            .need = Need::in_table,
            .when = "normal_load.law=wedge",
            .only_then = true}),
};

constexpr std::array after_friction = {
    bound<&physics::Model::load_cell, &physics::LoadCell::mass_kg>(
        Key{.path = "load_cell.mass_kg",
            .unit = "kg",
            .sentence = "Mass on the load cell. Without [load_cell]: rigid attachment.",
            .need = Need::in_table,
            .low = 0,
            .above_low = true}),
    bound<&physics::Model::load_cell, &physics::LoadCell::natural_frequency_hz>(
        Key{.path = "load_cell.natural_frequency_hz",
            .unit = "Hz",
            .sentence = "Natural frequency of the load cell.",
            .need = Need::in_table,
            .low = 0,
            .above_low = true}),
    bound<&physics::Model::load_cell, &physics::LoadCell::damping_ratio>(
        Key{.path = "load_cell.damping_ratio",
            .unit = "1",
            .sentence = "Damping ratio of the load cell.",
            .need = Need::in_table,
            .low = 0}),
    bound<&physics::Model::load_cell, &physics::LoadCell::dynamics>(
        Key{.path = "load_cell.dynamics",
            .sentence = "Eq. (1) of the paper, or the full dynamics of the load cell.",
            .need = Need::in_table}),
    bound<&physics::Model::normal_load_bridge, &physics::NormalLoadBridge::mismatch>(
        Key{.path = "normal_load_bridge.mismatch",
            .unit = "1",
            .sentence = "The gauges of both pads are in one bridge, which reads only v1 + v2: "
                        "relative difference of their calibrations, (c1 - c2) / (c1 + c2). Without "
                        "[normal_load_bridge]: the reading is N.",
            .need = Need::in_table,
            .low = -1,
            .above_low = true}),
    bound<&physics::Model::normal_load_bridge, &physics::NormalLoadBridge::share>(
        Key{.path = "normal_load_bridge.share",
            .unit = "1",
            .sentence = "Share of the normal load on the first pad, at displacement 0.",
            .low = 0,
            .high = 1}),
    bound<&physics::Model::normal_load_bridge, &physics::NormalLoadBridge::share_slope_per_m>(
        Key{.path = "normal_load_bridge.share_slope_per_m",
            .unit = "1/m",
            .sentence = "Change of that share with displacement; it stays within 0 to 1."}),
    bound<&physics::Model::sensors, by_channel, &physics::Sensor::noise_std>(
        Key{.path = "sensors.*.noise_std",
            .unit = "the channel's",
            .sentence = "Standard deviation of the reading's noise.",
            .without = "unknown: estimated",
            .low = 0,
            .above_low = true}),
    bound<&physics::Model::sensors, by_channel, &physics::Sensor::noise_correlation_s>(
        Key{.path = "sensors.*.noise_correlation_s",
            .unit = "s",
            .sentence = "Correlation time of the noise; 0: white.",
            .without = "not declared: estimated",
            .low = 0}),
    bound<&physics::Model::sensors, by_channel, &physics::Sensor::gain>(
        Key{.path = "sensors.*.gain",
            .unit = "1",
            .sentence = "Reading over true value. 1.0 without a sigma: exact.",
            .without = "1; a diagnosis allows 0.5 %"}),
    bound<&physics::Model::sensors, by_channel, &physics::Sensor::offset>(
        Key{.path = "sensors.*.offset",
            .unit = "the channel's",
            .sentence = "Reading at a true value of 0.",
            .without = "0; a diagnosis allows 1 % of the channel's standard deviation"}),
    bound<&physics::Model::sensors, by_channel, &physics::Sensor::delay_s>(
        Key{.path = "sensors.*.delay_s",
            .unit = "s",
            .sentence = "Delay of the reading beyond that of its filters.",
            .without = "0; a diagnosis allows 0.3 samples and 2 % of the filters' cut-offs",
            .low = -0.03,
            .high = 0.03}),
    bound<&physics::Model::sensors, by_channel, &physics::Sensor::filters>(
        Key{.path = "sensors.*.filters",
            .sentence = "Analogue filters in the order of the signal; those of the velocity follow "
                        "those of the displacement.",
            .without = "none"}),
    read_by<physics::Model, read_terms>(
        Type::terms,
        Key{.path = "physics",
            .sentence = "One [[physics]] table for each term added by a diagnosis, or for a "
                        "formula of your own (docs/formulas.md).",
            .without = "none"}),
    bound<&physics::Model::candidates>(
        Key{.path = "candidate",
            .sentence = "One [[candidate]] table for each formula of your own that a diagnosis "
                        "tries beside the catalogue.",
            .without = "none"}),
};

constexpr std::array filter_table = {
    bound<&physics::Filter::kind>(
        Key{.path = "kind", .sentence = "Type of filter.", .need = Need::always}),
    bound<&physics::Filter::order>(Key{.path = "order",
                                       .unit = "1",
                                       .sentence = "Number of poles.",
                                       .need = Need::always,
                                       .when = "kind=butterworth_lowpass",
                                       .only_then = true,
                                       .low = 1,
                                       .high = 8}),
    bound<&physics::Filter::cutoff_hz>(Key{.path = "cutoff_hz",
                                           .unit = "Hz",
                                           .sentence = "Frequency of half power.",
                                           .need = Need::always,
                                           .low = 0,
                                           .above_low = true}),
};

constexpr std::array term_table = {
    bound<&physics::Term::id>(Key{.path = "id",
                                  .sentence = "Effect of the catalogue; its parameters are further "
                                              "keys, each a number or { value, sigma }.",
                                  .need = Need::always}),
    bound<&physics::Term::channel>(
        Key{.path = "channel",
            .sentence = "The affected channel; effects of the relation sensor only."}),
    bound<&physics::Term::from>(
        Key{.path = "from", .sentence = "The source channel; crosstalk only."}),
};

using physics::FormulaDeclaration;
using physics::FormulaQuantity;

template <FormulaQuantity quantity>
void read_formula(FormulaDeclaration& target, std::size_t channel, const Value& value) {
  target.quantity = quantity;
  target.text = value.text();
  if (quantity == FormulaQuantity::reading) target.channel = all_channels[channel];
}

void read_parameters(FormulaDeclaration& target, std::size_t /*channel*/, const Value& value) {
  for (const auto& [name, each] : value.entries()) {
    const auto unit = each.at("unit");
    target.parameters.push_back({name, unit ? unit->text() : std::string()});
  }
}

void read_states(FormulaDeclaration& target, std::size_t /*channel*/, const Value& value) {
  const auto text_at = [](const Value& state, std::string_view key) {
    const auto found = state.at(key);
    return found ? found->text() : std::string();
  };
  for (const auto& [name, each] : value.entries()) {
    const auto size = each.at("size");
    target.states.push_back({name, text_at(each, "rate"), text_at(each, "within"),
                             text_at(each, "unit"), size ? size->number() : 0.0});
  }
}

void read_nothing(FormulaDeclaration& /*target*/, std::size_t /*channel*/, const Value& /*value*/) {
}

// Names of physics::Relation.
constexpr std::array<std::string_view, 4> formula_relations = {"force_balance", "friction_law",
                                                               "normal_load", "sensor"};

constexpr std::array formula_table = {
    bound<&FormulaDeclaration::id>(
        Key{.path = "id", .sentence = "A name of your own.", .need = Need::always}),
    read_by<FormulaDeclaration, read_nothing>(Type::choice,
                                              Key{.path = "relation",
                                                  .sentence = "What the formula enters.",
                                                  .without = "follows from the key of the formula",
                                                  .choices = formula_relations}),
    read_by<FormulaDeclaration, read_formula<FormulaQuantity::force>>(
        Type::text,
        Key{.path = "force",
            .sentence = "A force on the mass against +x [N], added to the others. A table "
                        "has one of force, friction, load and reading."}),
    read_by<FormulaDeclaration, read_formula<FormulaQuantity::friction>>(
        Type::text, Key{.path = "friction",
                        .sentence = "The coefficient of friction, from the declared one, mu."}),
    read_by<FormulaDeclaration, read_formula<FormulaQuantity::load>>(
        Type::text,
        Key{.path = "load", .sentence = "The normal load [N], from the declared one, N."}),
    read_by<FormulaDeclaration, read_formula<FormulaQuantity::reading>>(
        Type::text,
        Key{.path = "reading.*", .sentence = "The reading of a channel, from the right one, r."}),
    read_by<FormulaDeclaration, read_parameters>(
        Type::parameters,
        Key{.path = "parameters",
            .sentence = "The formula's parameters, each a number or { value, sigma, unit }.",
            .without = "none"}),
    read_by<FormulaDeclaration, read_states>(
        Type::states,
        Key{.path = "states",
            .sentence = "States of its own, 0 at the beginning: rate and within are formulas, size "
                        "is a typical magnitude.",
            .without = "none"}),
};

constexpr std::array candidate_file_table = {
    schema_key<CandidateFile>(),
    bound<&CandidateFile::candidates>(
        Key{.path = "candidate",
            .sentence = "One table for each formula that a diagnosis tries beside the catalogue.",
            .without = "none"}),
};

}  // namespace

template <>
std::span<const Key> keys_of<FormulaDeclaration>() {
  static const std::vector<Key> keys = joined<FormulaDeclaration>({formula_table});
  return keys;
}

template <>
std::span<const Key> keys_of<CandidateFile>() {
  static const std::vector<Key> keys = joined<CandidateFile>({candidate_file_table});
  return keys;
}

template <>
std::span<const Key> keys_of<physics::Model>() {
  static const std::vector<Key> keys =
      joined<physics::Model>({model_table, friction_keys(), after_friction});
  return keys;
}

template <>
std::span<const Key> keys_of<physics::Filter>() {
  static const std::vector<Key> keys = joined<physics::Filter>({filter_table});
  return keys;
}

template <>
std::span<const Key> keys_of<physics::Term>() {
  static const std::vector<Key> keys = joined<physics::Term>({term_table});
  return keys;
}

std::span<const Key> model_keys() { return keys_of<physics::Model>(); }

}  // namespace stickslip::config
