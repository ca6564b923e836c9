// SPDX-License-Identifier: Apache-2.0
#include "physics/catalogue.h"
#include "physics/model_consistency.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "physics/declared_value.h"
#include "physics/reading.h"
#include "physics/rig.h"
#include "tests/unit/physics/rigs.h"

namespace stickslip::physics {
namespace {

// docs/formats.md, section 6: ids and parameter names are fixed.
struct ListedEntry {
  Relation relation;
  std::vector<std::string> parameters;
};
const std::map<std::string, ListedEntry>& listed() {
  static const std::map<std::string, ListedEntry> entries = {
      {"dry_friction", {Relation::friction_law, {"friction_force_n"}}},
      {"friction_memory", {Relation::friction_law, {"gamma_per_s"}}},
      {"stribeck", {Relation::friction_law, {"static_ratio", "stribeck_speed_m_s"}}},
      {"dwell_strengthening", {Relation::friction_law, {"beta", "tau_s"}}},
      {"contact_compliance", {Relation::friction_law, {"contact_stiffness_n_m"}}},
      {"load_dependent_mu", {Relation::friction_law, {"exponent"}}},
      {"asymmetric_friction", {Relation::friction_law, {"asymmetry"}}},
      {"position_dependent_mu", {Relation::friction_law, {"slope_per_m"}}},
      {"friction_drift", {Relation::friction_law, {"rate_per_s"}}},
      {"quadratic_drag", {Relation::force_balance, {"drag_n_s2_m2"}}},
      {"cubic_stiffness", {Relation::force_balance, {"k3_n_m3"}}},
      {"hysteresis", {Relation::force_balance, {"stiffness_n_m", "slip_force_n"}}},
      {"end_stop", {Relation::force_balance, {"gap_m", "stiffness_n_m"}}},
      {"bias_force", {Relation::force_balance, {"force_n"}}},
      {"ambient_vibration", {Relation::force_balance, {"frequency_hz", "amplitude_n"}}},
      {"second_mode", {Relation::force_balance, {"frequency_hz"}}},
      {"wedge_load", {Relation::normal_load, {"slope_per_m"}}},
      {"load_cell_resonance", {Relation::load_cell, {"frequency_hz", "damping_ratio"}}},
      {"differentiator_lag", {Relation::kinematics, {"cutoff_hz"}}},
      {"channel_delay", {Relation::sensor, {"delay_s"}}},
      {"gain_error", {Relation::sensor, {"gain"}}},
      {"crosstalk", {Relation::sensor, {"coefficient"}}},
      {"clipping", {Relation::sensor, {"limit"}}},
      {"mains_hum", {Relation::sensor, {"frequency_hz", "amplitude"}}},
      {"sensor_drift", {Relation::sensor, {"rate_per_s"}}},
      {"sensor_offset", {Relation::sensor, {"offset"}}},
      {"declared_value", {Relation::force_balance, {"value"}}},
  };
  return entries;
}

/// A number of the model itself is no term: see physics/declared_value.h.
bool is_term(const Effect& effect) { return effect.hooks() != 0; }

class EveryEffect : public testing::TestWithParam<const Effect*> {};

TEST_P(EveryEffect, IsNamedAsInTheFormats) {
  const Card& card = GetParam()->card();
  const auto entry = listed().find(std::string(card.id));
  if (!card.depends_on.empty()) {
    // Reported as "unlisted", with the variables that it depends on.
    EXPECT_EQ(entry, listed().end());
    for (const std::string_view name : card.depends_on) {
      EXPECT_TRUE(name == "time" || channel_named(name).has_value()) << name;
    }
    return;
  }
  ASSERT_NE(entry, listed().end());
  EXPECT_EQ(card.relation, entry->second.relation);
  std::vector<std::string> estimated;
  for (const ParameterCard& parameter : card.parameters) {
    if (!parameter.fixed_default) estimated.emplace_back(parameter.name);
  }
  // Further parameters may follow the listed ones.
  ASSERT_GE(estimated.size(), entry->second.parameters.size());
  estimated.resize(entry->second.parameters.size());
  EXPECT_EQ(estimated, entry->second.parameters);
}

TEST_P(EveryEffect, IsDescribedCompletely) {
  const Card& card = GetParam()->card();
  EXPECT_FALSE(card.name.empty());
  EXPECT_GT(card.sentence.size(), 20U);
  EXPECT_EQ(card.sentence.back(), '.');
  EXPECT_FALSE(card.equation.empty());
  EXPECT_FALSE(card.experiment.empty());
  ASSERT_LE(card.parameters.size(), static_cast<std::size_t>(max_effect_parameters));
  std::vector<double> middle;
  for (const ParameterCard& parameter : card.parameters) {
    EXPECT_FALSE(parameter.unit.empty()) << parameter.name;
    EXPECT_FALSE(parameter.meaning.empty()) << parameter.name;
    EXPECT_LT(parameter.low, parameter.high) << parameter.name;
    if (parameter.positive) {
      EXPECT_GT(parameter.low, 0.0) << parameter.name;
    }
    middle.push_back(parameter.positive ? std::sqrt(parameter.low * parameter.high)
                                        : 0.7 * parameter.low + 0.3 * parameter.high);
  }
  // A picture for every term, and literature with a year.
  EXPECT_EQ(card.example.size(), is_term(*GetParam()) ? card.parameters.size() : 0U);
  for (std::size_t i = 0; i < card.example.size(); ++i) {
    if (card.parameters[i].fixed_default == card.example[i]) continue;
    EXPECT_GE(card.example[i], card.parameters[i].low) << card.parameters[i].name;
    EXPECT_LE(card.example[i], card.parameters[i].high) << card.parameters[i].name;
  }
  for (const std::string_view reference : card.references) {
    ASSERT_GT(reference.size(), 20U);
    const int year = std::stoi(std::string(reference.substr(reference.size() - 4)));
    EXPECT_TRUE(year > 1780 && year < 2027) << reference;
  }
  const std::string statement = GetParam()->statement(middle, {});
  EXPECT_GT(statement.size(), 20U);
  EXPECT_EQ(statement.back(), '.');
  // The statement contains a number.
  std::vector<double> other = middle;
  other[0] *= 1.7;
  EXPECT_NE(GetParam()->statement(other, {}), statement);
  // Of a sensor effect it names the channel.
  if (card.relation == Relation::sensor) {
    const std::string placed = GetParam()->statement(middle, {Channel::velocity, {}});
    EXPECT_TRUE(placed.find("velocity") != std::string::npos) << placed;
  }
  for (const std::string_view rival : card.rivals) {
    EXPECT_NE(rival, card.id);
    EXPECT_NE(find_effect(rival), nullptr) << rival;
  }
}

Scales scales_of_a_bench() {
  return {.displacement_m = 0.02,
          .velocity_m_s = 0.2,
          .force_n = 0.5,
          .friction_n = 0.12,
          .stiffness_n_m = 13.6,
          .mean_load_n = 0.15,
          .duration_s = 60.0,
          .sample_period_s = 1.0e-3,
          .mass_kg = 0.06,
          .transition_speed_m_s = 0.003,
          .cell_frequency_hz = 19.3,
          .cell_damping_ratio = 0.016,
          .lowest_load_n = 0.1,
          .highest_load_n = 0.2,
          .frequencies_hz = {7.0, 37.0},
          .channel = {0.02, 0.01, 0.018, {50.0, 1.0e-4, 0.3}},
          .from = {},
          .episodes_s = {{12.0, 17.0}}};
}

TEST_P(EveryEffect, StartsInsideItsRangesWithTheParametersToEstimate) {
  if (!is_term(*GetParam()))
    GTEST_SKIP() << "stands for a declared number, not for a term of a model";
  const Effect& effect = *GetParam();
  const Scales scales = scales_of_a_bench();
  std::size_t estimated = 0;
  std::size_t fixed = 0;
  for (const ParameterCard& parameter : effect.card().parameters) {
    ++(parameter.fixed_default ? fixed : estimated);
  }
  ASSERT_FALSE(effect.starts(scales).empty());
  for (const auto& start : effect.starts(scales)) {
    ASSERT_TRUE(start.size() == estimated || start.size() == estimated + fixed);
    for (std::size_t i = 0; i < start.size(); ++i) {
      EXPECT_TRUE(std::isfinite(start[i]));
      if (effect.card().parameters[i].positive) {
        EXPECT_GT(start[i], 0.0);
      }
    }
  }
  const auto values = effect.fixed(scales);
  EXPECT_TRUE(values.empty() || values.size() == fixed);
}

// A model that lacks the effect, and parameters at which the effect is visible there.
struct Setting {
  Model model;
  std::map<std::string, Parameter> parameters;
  Place place = {};
};

struct VisibleEffect {
  std::string id;
  std::map<std::string, Parameter> parameters;
  Place place = {};
};

const std::vector<VisibleEffect>& friction_effects() {
  static const std::vector<VisibleEffect> list = {
      {"dry_friction", {{"friction_force_n", {0.1}}, {"transition_speed_m_s", {0.01}}}},
      {"friction_memory", {{"gamma_per_s", {60.0}}}},
      {"stribeck", {{"static_ratio", {1.4}}, {"stribeck_speed_m_s", {0.05}}}},
      {"contact_compliance", {{"contact_stiffness_n_m", {150.0}}}},
      {"load_dependent_mu", {{"exponent", {-0.33}}, {"reference_load_n", {0.15}}}},
      {"asymmetric_friction", {{"asymmetry", {0.2}}}},
      {"position_dependent_mu", {{"slope_per_m", {15.0}}}},
      {"friction_drift", {{"rate_per_s", {0.3}}}},
      {"dwell_strengthening",
       {{"beta", {0.2}},
        {"tau_s", {0.01}},
        {"stuck_speed_m_s", {0.02}},
        {"slip_length_m", {2.0e-4}}}},
      {"contact_viscosity", {{"slope_s_m", {2.0}}}},
      {"logarithmic_friction", {{"coefficient", {0.05}}, {"reference_speed_m_s", {0.01}}}},
      {"periodic_friction", {{"share", {0.2}}, {"wavelength_m", {0.004}}, {"phase_rad", {0.4}}}},
      {"rate_and_state",
       {{"direct_effect", {0.05}},
        {"evolution_effect", {0.06}},
        {"slip_length_m", {2.0e-4}},
        {"reference_speed_m_s", {0.003}}}},
      {"load_history",
       {{"share", {0.6}}, {"slip_length_m", {0.002}}, {"reference_load_n", {0.15}}}},
      {"friction_episode", {{"share", {0.4}}, {"begin_s", {0.21}}, {"end_s", {0.47}}}}};
  return list;
}

const std::vector<VisibleEffect>& force_and_load_effects() {
  static const std::vector<VisibleEffect> list = {
      {"quadratic_drag", {{"drag_n_s2_m2", {0.5}}}},
      {"cubic_stiffness", {{"k3_n_m3", {5.0e4}}}},
      {"hysteresis", {{"stiffness_n_m", {8.0}}, {"slip_force_n", {0.05}}}},
      {"bias_force", {{"force_n", {0.05}}}},
      {"end_stop", {{"gap_m", {0.003}}, {"stiffness_n_m", {20.0}}}},
      {"ambient_vibration",
       {{"frequency_hz", {7.0}},
        {"amplitude_n", {0.05}},
        {"phase_rad", {0.4}},
        {"second_sin", {0.2}},
        {"second_cos", {-0.1}}}},
      {"second_mode",
       {{"frequency_hz", {37.0}},
        {"friction_share_per_kg", {2.0}},
        {"base_share", {0.1}},
        {"damping_ratio", {0.02}}}},
      {"quadratic_stiffness", {{"k2_n_m2", {500.0}}}},
      {"position_dependent_damping", {{"c1_n_s_m2", {5.0}}, {"c2_n_s_m3", {1000.0}}}},
      {"quintic_stiffness", {{"k5_n_m5", {3.0e9}}}},
      {"force_episode", {{"force_n", {0.05}}, {"begin_s", {0.21}}, {"end_s", {0.47}}}},
      {"wedge_load", {{"slope_per_m", {20.0}}}},
      {"load_curvature", {{"curvature_per_m2", {5000.0}}}},
      {"load_vibration", {{"share", {0.2}}, {"frequency_hz", {11.0}}, {"phase_rad", {0.4}}}},
      {"load_episode", {{"share", {0.4}}, {"begin_s", {0.21}}, {"end_s", {0.47}}}}};
  return list;
}

const std::vector<VisibleEffect>& sensor_effects() {
  static const std::vector<VisibleEffect> list = {
      {"load_cell_resonance", {{"frequency_hz", {15.0}}, {"damping_ratio", {0.05}}}},
      {"differentiator_lag", {{"cutoff_hz", {30.0}}}},
      {"channel_delay", {{"delay_s", {0.00712}}}, {Channel::friction_force, {}}},
      {"gain_error", {{"gain", {1.2}}}, {Channel::velocity, {}}},
      {"crosstalk", {{"coefficient", {0.2}}}, {Channel::velocity, Channel::friction_force}},
      {"clipping", {{"limit", {0.0005}}}, {Channel::displacement, {}}},
      {"mains_hum",
       {{"frequency_hz", {50.0}}, {"amplitude", {0.01}}, {"phase_rad", {0.4}}},
       {Channel::friction_force, {}}},
      {"sensor_drift",
       {{"rate_per_s", {0.01}}, {"approach_s", {20.0}}},
       {Channel::normal_load, {}}},
      {"sensor_offset", {{"offset", {0.002}}}, {Channel::displacement, {}}},
      {"bridge_nonlinearity", {{"curvature", {20.0}}}, {Channel::displacement, {}}}};
  return list;
}

VisibleEffect free_form_effect(const std::string& id) {
  VisibleEffect out{id, {}};
  const double size = id.starts_with("force") ? 0.03 : 0.3;
  const double heights[] = {0.1, -0.2, 0.3, 0.7, -0.5, 0.9, 0.4, 0.2};
  for (int k = 0; k < 8; ++k) {
    out.parameters["at_" + std::to_string(k + 1)] = {size * heights[k]};
  }
  const double reach = id.ends_with("displacement") ? 0.006
                       : id.ends_with("velocity")   ? 0.12
                       : id.ends_with("load")       ? 0.2
                                                    : 0.5;
  const bool from_zero = id.ends_with("time") || id.ends_with("load");
  out.parameters["low"] = {from_zero ? 0.0 : -1.1 * reach};
  out.parameters["high"] = {reach};
  return out;
}

// For an effect without an entry above: its first starting values, with a hundredth of the range in
// place of neutral ones, on the first channel that it acts on.
VisibleEffect started_effect(const Effect& effect) {
  VisibleEffect out{std::string(effect.card().id), {}};
  const auto cards = effect.card().parameters;
  const std::vector<double> start = effect.starts(scales_of_a_bench()).front();
  std::size_t next = 0;
  for (const ParameterCard& card : cards) {
    if (card.fixed_default && start.size() != cards.size()) continue;
    const double value = start[next++];
    out.parameters[std::string(card.name)] = {
        value == card.neutral ? value + 0.01 * (card.high - card.neutral) : value};
  }
  if (effect.card().relation != Relation::sensor) return out;
  for (const Channel channel : all_channels) {
    if (!out.place.channel && effect.acts_on({channel, {}})) out.place.channel = channel;
  }
  return out;
}

VisibleEffect visible_effect(const Effect& effect) {
  const std::string id(effect.card().id);
  if (effect.card().tier == Tier::free_form) return free_form_effect(id);
  for (const auto* list : {&friction_effects(), &force_and_load_effects(), &sensor_effects()}) {
    for (const VisibleEffect& each : *list) {
      if (each.id == id) return each;
    }
  }
  return started_effect(effect);
}

Setting setting_for(const Effect& effect) {
  const VisibleEffect visible = visible_effect(effect);
  Setting s{test::bench(), visible.parameters, visible.place};
  s.model.friction.transition_speed_m_s = {0.01};
  if (visible.id == "dry_friction") {
    s.model.friction = {};
    s.model.normal_load.reset();
    s.model.load_cell.reset();
  }
  if (visible.id == "load_dependent_mu" || visible.id == "friction_over_load") {
    s.model.normal_load = NormalLoad{NormalLoadLaw::wedge, {0.15}, {20.0}};
  }
  if (visible.id == "load_history") {
    s.model.normal_load = NormalLoad{NormalLoadLaw::wedge, {0.15}, {40.0}};
  }
  if (visible.id == "load_cell_resonance") {
    s.model.load_cell->dynamics = LoadCellDynamics::quasi_static;
  }
  return s;
}

// x and v of the mass and the readings of the four mechanical channels.
template <class T>
using Sample = std::array<T, 6>;

// Ten samples, so that an effect that acts in one direction only is seen, too.
template <class T>
std::vector<Sample<T>> run_for_half_a_second(const Model& model, const Rig& rig,
                                             const std::vector<T>& parameters) {
  const auto n = rig.numbers<T>(std::span<const T>(parameters));
  RigState<T> state;
  state.s[state::x] = T(0.004);
  const double h = 2.5e-4;
  const auto input = [](double time) {
    Input now;
    now.base_acceleration_m_s2 = -2.5 * std::cos(2.0 * std::numbers::pi * 2.9 * time);
    return now;
  };
  const SensorBank bank(model, h);
  const SensorErrors<T> faults(n.reading, bank, h);
  SensorMemory<T> chains;
  SensorErrorState<T> memory;
  bank.settle(chains, rig.quantities(state, input(0.0), n));
  faults.settle(memory, chains);
  std::vector<Sample<T>> samples;
  for (int k = 0; k < 2000; ++k) {
    rig.step(state, input(k * h), input((k + 1) * h), k * h, h, n);
    bank.advance(chains, rig.quantities(state, input((k + 1) * h), n));
    faults.advance(memory, chains);
    if ((k + 1) % 200 != 0) continue;
    const Readings<T> r = faults.readings(memory, chains, (k + 1) * h);
    samples.push_back({state.s[state::x], state.s[state::v], r.displacement, r.velocity,
                       r.friction_force, r.normal_load});
  }
  return samples;
}

// The knots of a free-form curve are never fitted.
bool is_knot(const Effect& effect, std::string_view path) {
  return effect.card().tier == Tier::free_form &&
         (path.ends_with(".low") || path.ends_with(".high"));
}

// Derivatives with respect to one parameter against central differences.
void expect_derivatives(const Model& model, const Rig& rig, std::size_t parameter,
                        const std::vector<Sample<double>>& plain) {
  const auto& values = rig.parameter_values();
  const double value = values[parameter];
  std::vector<Dual> duals(values.begin(), values.end());
  duals[parameter].d[0] = 1.0;
  const auto exact = run_for_half_a_second(model, rig, duals);
  const double step = 1.0e-5 * std::max(std::abs(value), 1.0e-6);
  auto up = values;
  auto down = values;
  up[parameter] += step;
  down[parameter] -= step;
  const auto high = run_for_half_a_second(model, rig, up);
  const auto low = run_for_half_a_second(model, rig, down);
  for (std::size_t k = 0; k < exact.size(); ++k) {
    for (std::size_t s = 0; s < exact[k].size(); ++s) {
      EXPECT_NEAR(exact[k][s].a, plain[k][s], 1.0e-12) << "sample " << k << ", number " << s;
      const double difference = (high[k][s] - low[k][s]) / (2.0 * step);
      const double scale = std::abs(plain[k][s]) / std::max(std::abs(value), 1.0e-6);
      EXPECT_NEAR(exact[k][s].d[0], difference, 2.0e-4 * scale + 3.0e-3 * std::abs(difference))
          << rig.parameter_paths()[parameter] << ", sample " << k << ", number " << s;
    }
  }
}

TEST_P(EveryEffect, ChangesTheMotionOrItsReadingsWithExactDerivatives) {
  if (!is_term(*GetParam()))
    GTEST_SKIP() << "stands for a declared number, not for a term of a model";
  const Effect& effect = *GetParam();
  const Setting setting = setting_for(effect);
  const Place& place = setting.place;
  EXPECT_TRUE(can_be_missing(effect, setting.model, place));
  Model model = setting.model;
  model.terms.push_back(
      {std::string(effect.card().id), place.channel, setting.parameters, place.from});
  ASSERT_TRUE(inconsistencies_of(model).empty()) << inconsistencies_of(model).front().message;
  EXPECT_FALSE(can_be_missing(effect, model, place)) << "it is included";
  const Rig rig(model);
  const auto plain = run_for_half_a_second(model, rig, rig.parameter_values());
  for (std::size_t i = 0; i < rig.parameter_values().size(); ++i) {
    if (!is_knot(effect, rig.parameter_paths()[i])) expect_derivatives(model, rig, i, plain);
  }

  const Rig without(setting.model);
  const auto other = run_for_half_a_second(setting.model, without, without.parameter_values());
  double difference = 0.0;
  for (std::size_t k = 0; k < plain.size(); ++k) {
    for (std::size_t s = 0; s < plain[k].size(); ++s) {
      difference += std::abs(other[k][s] - plain[k][s]);
    }
  }
  EXPECT_GT(difference, 1.0e-6);
}

// Terms are bound by position; the paths, which reports print, agree.
TEST_P(EveryEffect, IsBoundToItsParameters) {
  if (!is_term(*GetParam()))
    GTEST_SKIP() << "stands for a declared number, not for a term of a model";
  const Effect& effect = *GetParam();
  const Setting setting = setting_for(effect);
  Model model = setting.model;
  model.terms.push_back(
      {"position_dependent_damping", {}, {{"c1_n_s_m2", {5.0}}, {"c2_n_s_m3", {1.0}}}});
  if (effect.card().id == "position_dependent_damping") model.terms.pop_back();
  const Place& place = setting.place;
  model.terms.push_back(
      {std::string(effect.card().id), place.channel, setting.parameters, place.from});
  const Rig rig(model);
  const BoundTerm& bound = rig.terms().back();
  EXPECT_EQ(bound.effect, &effect);
  EXPECT_EQ(bound.place, place);
  const auto cards = effect.card().parameters;
  const auto values = bound.values(std::span(rig.parameter_values()));
  ASSERT_EQ(values.size(), cards.size());
  for (std::size_t i = 0; i < cards.size(); ++i) {
    const std::string name(cards[i].name);
    const auto given = setting.parameters.find(name);
    EXPECT_EQ(values[i], given == setting.parameters.end() ? cards[i].fixed_default.value_or(0.0)
                                                           : given->second.value);
    if (bound.parameter[i] < 0) continue;
    EXPECT_EQ(rig.parameter_paths()[static_cast<std::size_t>(bound.parameter[i])],
              path_of(model.terms.back()) + "." + name);
  }
}

// Positions on the card that other rooms rely on.
TEST_P(EveryEffect, RefersToItsOwnParameters) {
  const Card& card = GetParam()->card();
  const auto unit_of = [&](std::size_t i) {
    return i < card.parameters.size() ? card.parameters[i].unit : std::string_view("missing");
  };
  if (card.strength) {
    EXPECT_LT(*card.strength, card.parameters.size());
  }
  if (card.episode) {
    EXPECT_EQ(unit_of(card.episode->begin_s), "s");
    EXPECT_EQ(unit_of(card.episode->end_s), "s");
  }
  if (card.frequency) {
    EXPECT_EQ(unit_of(card.frequency->parameter), "Hz");
  }
  if (card.transition_speed) {
    EXPECT_EQ(unit_of(*card.transition_speed), "m/s");
  }
}

INSTANTIATE_TEST_SUITE_P(Catalogue, EveryEffect,
                         testing::ValuesIn(catalogue().begin(), catalogue().end()),
                         [](const auto& info) { return std::string(info.param->card().id); });

// Order: tier, relation, id.
TEST(Catalogue, IsOrderedByTheCards) {
  const auto rank = [](const Effect* effect) {
    const Card& card = effect->card();
    return std::tuple(card.tier, card.relation, card.id);
  };
  EXPECT_TRUE(std::is_sorted(catalogue().begin(), catalogue().end(),
                             [&](const Effect* a, const Effect* b) { return rank(a) < rank(b); }));
}

TEST(Catalogue, FindsEveryEffectByItsIdAndNoOther) {
  std::set<std::string_view> ids;
  for (const Effect* effect : catalogue()) {
    EXPECT_EQ(find_effect(effect->card().id), effect);
    EXPECT_TRUE(ids.insert(effect->card().id).second);
  }
  EXPECT_GE(ids.size(), listed().size());
  for (const auto& [id, entry] : listed()) EXPECT_TRUE(ids.contains(id)) << id;
  EXPECT_EQ(find_effect("unlisted"), nullptr);
}

TEST(DeclaredValue, StandsInNoModelAndNamesTheNumbersOfAll) {
  Model model = test::bench();
  EXPECT_FALSE(can_be_missing(declared_value(), model));
  model.friction.transition_speed_m_s = {0.0};  // the set-valued law, no number
  model.terms.push_back({"cubic_stiffness", {}, {{"k3_n_m3", {1.0e4}}}});
  const auto paths = contradictable_numbers(model);
  const auto holds = [&](const char* path) {
    return std::find(paths.begin(), paths.end(), path) != paths.end();
  };
  EXPECT_TRUE(holds("oscillator.mass_kg"));
  EXPECT_TRUE(holds("friction.mu"));
  EXPECT_TRUE(holds("physics.cubic_stiffness.k3_n_m3"));
  EXPECT_FALSE(holds("friction.transition_speed_m_s"));
  EXPECT_EQ(relation_of("friction.mu", {}), Relation::friction_law);
  EXPECT_EQ(relation_of("oscillator.mass_kg", {}), Relation::force_balance);
  EXPECT_EQ(relation_of("physics.stribeck.static_ratio", {}), Relation::friction_law);
  EXPECT_FALSE(is_signed("oscillator.damping_ratio", {}));
  EXPECT_TRUE(is_signed("physics.cubic_stiffness.k3_n_m3", {}));
  EXPECT_EQ(contradiction("oscillator.damping_ratio", 0.02, 0.06),
            "damping_ratio is 0.06, not 0.02");
  EXPECT_EQ(contradiction("oscillator.mass_kg", 1.0, 1.0004), "mass_kg is 1.0004, not 1");
}

TEST(Units, FollowFromTheNameOfANumberAndItsPlace) {
  const std::map<std::string, std::string> units = {
      {"oscillator.mass_kg", "kg"},
      {"oscillator.two_well.cubic_n_m3", "N/m3"},
      {"oscillator.damping_n_s_m", "N s/m"},
      {"oscillator.damping_ratio", "1"},
      {"normal_load.load_n", "N"},
      {"normal_load.slope_per_m", "1/m"},
      {"friction.mu", "1"},
      {"friction.transition_speed_m_s", "m/s"},
      {"sensors.velocity.offset", "m/s"},
      {"sensors.velocity.delay_s", "s"},
      {"sensors.velocity.filters.0.cutoff_hz", "Hz"},
      {"physics.sensor_offset.displacement.offset", "m"},
  };
  for (const auto& [path, unit] : units) EXPECT_EQ(unit_of(path, {}), unit) << path;
  const Place leak{Channel::friction_force, Channel::velocity};
  EXPECT_EQ(unit_at(find_effect("crosstalk")->card().parameters[0].unit, leak), "N/(m/s)");
}

TEST(Catalogue, ListsTheEffectsAModelCanLack) {
  Model none = test::bench();
  none.friction = {};
  const Model coulomb = test::bench();
  Model memory = test::bench();
  memory.friction.law = FrictionLaw::state_variable;
  memory.friction.rate_per_s = {100.0};
  Model wedge = test::bench();
  wedge.normal_load->law = NormalLoadLaw::wedge;
  const auto missing = [](const char* id, const Model& model) {
    return can_be_missing(*find_effect(id), model);
  };
  EXPECT_TRUE(missing("dry_friction", none));
  EXPECT_FALSE(missing("dry_friction", coulomb));
  EXPECT_FALSE(missing("friction_memory", none));
  EXPECT_TRUE(missing("friction_memory", coulomb));
  EXPECT_FALSE(missing("friction_memory", memory));
  EXPECT_FALSE(missing("stribeck", none));
  EXPECT_TRUE(missing("load_dependent_mu", wedge));
  EXPECT_FALSE(missing("load_history", coulomb)) << "a constant load has no history";
  EXPECT_TRUE(missing("load_history", wedge));
  EXPECT_TRUE(missing("wedge_load", coulomb));
  EXPECT_FALSE(missing("wedge_load", wedge));

  // A term makes others possible: friction that was found can then have a memory.
  none.terms.push_back({"dry_friction", {}, {{"friction_force_n", {0.1}}}});
  EXPECT_TRUE(missing("friction_memory", none));
  EXPECT_FALSE(missing("dry_friction", none));
}

TEST(Catalogue, ListsNoEffectThatTheModelHasNoRoomFor) {
  Model model = test::bench();
  for (const char* id : {"second_mode", "hysteresis", "dwell_strengthening"}) {
    EXPECT_TRUE(can_be_missing(*find_effect(id), model)) << id;
    model.terms.push_back({id, {}, started_effect(*find_effect(id)).parameters});
  }
  EXPECT_FALSE(can_be_missing(*find_effect("friction_memory"), model)) << "a fifth state";
  EXPECT_TRUE(can_be_missing(*find_effect("cubic_stiffness"), model));
}

}  // namespace
}  // namespace stickslip::physics
