#include "physics/effects/catalogue.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "physics/reading.h"
#include "physics/rig.h"
#include "tests/unit/physics/rigs.h"

namespace stickslip::physics {
namespace {

// Section 6 of the contract: ids and parameter names are fixed.
struct ContractEntry {
  Relation relation;
  std::vector<std::string> parameters;
};
const std::map<std::string, ContractEntry>& contract() {
  static const std::map<std::string, ContractEntry> entries = {
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
  };
  return entries;
}

class EveryEffect : public testing::TestWithParam<const Effect*> {};

TEST_P(EveryEffect, IsNamedAsTheContractSays) {
  const Card& card = GetParam()->card();
  const auto entry = contract().find(std::string(card.id));
  if (!card.depends_on.empty()) {
    // Reports call it "unlisted", and say what it depends on.
    EXPECT_EQ(entry, contract().end());
    for (const std::string_view name : card.depends_on) {
      EXPECT_TRUE(name == "time" || channel_named(name).has_value()) << name;
    }
    return;
  }
  ASSERT_NE(entry, contract().end());
  EXPECT_EQ(card.relation, entry->second.relation);
  std::vector<std::string> estimated;
  for (const ParameterCard& parameter : card.parameters) {
    if (!parameter.fixed_default) estimated.emplace_back(parameter.name);
  }
  // The contract's come first; a phase, say, may follow.
  ASSERT_GE(estimated.size(), entry->second.parameters.size());
  estimated.resize(entry->second.parameters.size());
  EXPECT_EQ(estimated, entry->second.parameters);
}

TEST_P(EveryEffect, SaysWhatAPersonMustKnow) {
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
  const std::string statement = GetParam()->statement(middle);
  EXPECT_GT(statement.size(), 20U);
  EXPECT_EQ(statement.back(), '.');
  // The statement says a number: another parameter, another statement.
  std::vector<double> other = middle;
  other[0] *= 1.7;
  EXPECT_NE(GetParam()->statement(other), statement);
  for (const std::string_view rival : card.rivals) {
    EXPECT_NE(rival, card.id);
    EXPECT_NE(find_effect(rival), nullptr) << rival;
  }
}

TEST_P(EveryEffect, StartsInsideItsRangesWithTheParametersToEstimate) {
  const Effect& effect = *GetParam();
  const Scales scales{.displacement_m = 0.02,
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

// A model to which the effect can be added, and values that make it visible there.
struct Setting {
  Model model;
  std::map<std::string, Parameter> parameters;
  Place place = {};
};
Setting setting_for(const std::string& id) {
  Setting s{test::bench(), {}, {}};
  s.model.friction.transition_speed_m_s = {0.01};
  if (id == "dry_friction") {
    s.model.friction = {};
    s.model.normal_load.reset();
    s.model.load_cell.reset();
    s.parameters = {{"friction_force_n", {0.1}}, {"transition_speed_m_s", {0.01}}};
  }
  if (id == "friction_memory") s.parameters = {{"gamma_per_s", {60.0}}};
  if (id == "stribeck") s.parameters = {{"static_ratio", {1.4}}, {"stribeck_speed_m_s", {0.05}}};
  if (id == "contact_compliance") s.parameters = {{"contact_stiffness_n_m", {150.0}}};
  if (id == "load_dependent_mu") {
    s.model.normal_load = NormalLoad{NormalLoadLaw::wedge, {0.15}, {20.0}};
    s.parameters = {{"exponent", {-0.33}}, {"reference_load_n", {0.15}}};
  }
  if (id == "asymmetric_friction") s.parameters = {{"asymmetry", {0.2}}};
  if (id == "position_dependent_mu") s.parameters = {{"slope_per_m", {15.0}}};
  if (id == "friction_drift") s.parameters = {{"rate_per_s", {0.3}}};
  if (id == "quadratic_drag") s.parameters = {{"drag_n_s2_m2", {0.5}}};
  if (id == "cubic_stiffness") s.parameters = {{"k3_n_m3", {5.0e4}}};
  if (id == "hysteresis") s.parameters = {{"stiffness_n_m", {8.0}}, {"slip_force_n", {0.05}}};
  if (id == "bias_force") s.parameters = {{"force_n", {0.05}}};
  if (id == "wedge_load") s.parameters = {{"slope_per_m", {20.0}}};
  if (id == "dwell_strengthening") {
    s.parameters = {{"beta", {0.2}},
                    {"tau_s", {0.01}},
                    {"stuck_speed_m_s", {0.02}},
                    {"slip_length_m", {2.0e-4}}};
  }
  if (id == "load_cell_resonance") {
    s.model.load_cell->dynamics = LoadCellDynamics::quasi_static;
    s.parameters = {{"frequency_hz", {15.0}}, {"damping_ratio", {0.05}}};
  }
  if (id == "end_stop") s.parameters = {{"gap_m", {0.003}}, {"stiffness_n_m", {20.0}}};
  if (id == "ambient_vibration") {
    s.parameters = {{"frequency_hz", {7.0}}, {"amplitude_n", {0.05}}, {"phase_rad", {0.4}}};
  }
  if (id == "second_mode") {
    s.parameters = {{"frequency_hz", {37.0}},
                    {"friction_share_per_kg", {2.0}},
                    {"base_share", {0.1}},
                    {"damping_ratio", {0.02}}};
  }
  if (id == "differentiator_lag") s.parameters = {{"cutoff_hz", {30.0}}};
  if (id == "channel_delay") {
    s.parameters = {{"delay_s", {0.00712}}};
    s.place.channel = Channel::friction_force;
  }
  if (id == "gain_error") {
    s.parameters = {{"gain", {1.2}}};
    s.place.channel = Channel::velocity;
  }
  if (id == "crosstalk") {
    s.parameters = {{"coefficient", {0.2}}};
    s.place = {Channel::velocity, Channel::friction_force};
  }
  if (id == "clipping") {
    s.parameters = {{"limit", {0.0005}}};
    s.place.channel = Channel::displacement;
  }
  if (id == "mains_hum") {
    s.parameters = {{"frequency_hz", {50.0}}, {"amplitude", {0.01}}, {"phase_rad", {0.4}}};
    s.place.channel = Channel::friction_force;
  }
  if (id == "sensor_drift") {
    s.parameters = {{"rate_per_s", {0.01}}, {"approach_s", {20.0}}};
    s.place.channel = Channel::normal_load;
  }
  if (id == "quadratic_stiffness") s.parameters = {{"k2_n_m2", {500.0}}};
  if (id == "position_dependent_damping") {
    s.parameters = {{"c1_n_s_m2", {5.0}}, {"c2_n_s_m3", {1000.0}}};
  }
  if (id == "contact_viscosity") s.parameters = {{"slope_s_m", {2.0}}};
  if (id == "logarithmic_friction") {
    s.parameters = {{"coefficient", {0.05}}, {"reference_speed_m_s", {0.01}}};
  }
  if (id == "periodic_friction") {
    s.parameters = {{"share", {0.2}}, {"wavelength_m", {0.004}}, {"phase_rad", {0.4}}};
  }
  if (id == "load_curvature") s.parameters = {{"curvature_per_m2", {5000.0}}};
  if (id == "quintic_stiffness") s.parameters = {{"k5_n_m5", {3.0e9}}};
  if (id == "rate_and_state") {
    s.parameters = {{"direct_effect", {0.05}},
                    {"evolution_effect", {0.06}},
                    {"slip_length_m", {2.0e-4}},
                    {"reference_speed_m_s", {0.003}}};
  }
  if (id == "load_history") {
    s.model.normal_load = NormalLoad{NormalLoadLaw::wedge, {0.15}, {40.0}};
    s.parameters = {{"share", {0.6}}, {"slip_length_m", {0.002}}, {"reference_load_n", {0.15}}};
  }
  if (id == "bridge_nonlinearity") {
    s.parameters = {{"curvature", {20.0}}};
    s.place.channel = Channel::displacement;
  }
  if (id == "load_vibration") {
    s.parameters = {{"share", {0.2}}, {"frequency_hz", {11.0}}, {"phase_rad", {0.4}}};
  }
  if (id == "load_episode" || id == "friction_episode") {
    s.parameters = {{"share", {0.4}}, {"begin_s", {0.21}}, {"end_s", {0.47}}};
  }
  if (id == "force_episode") {
    s.parameters = {{"force_n", {0.05}}, {"begin_s", {0.21}}, {"end_s", {0.47}}};
  }
  if (id.find("_over_") != std::string::npos) {
    if (id == "friction_over_load") {
      s.model.normal_load = NormalLoad{NormalLoadLaw::wedge, {0.15}, {20.0}};
    }
    const double size = id.starts_with("force") ? 0.03 : 0.3;
    const double heights[] = {0.1, -0.2, 0.3, 0.7, -0.5, 0.9, 0.4, 0.2};
    for (int k = 0; k < 8; ++k) {
      s.parameters["at_" + std::to_string(k + 1)] = {size * heights[k]};
    }
    const double reach = id.ends_with("displacement") ? 0.006
                         : id.ends_with("velocity")   ? 0.12
                         : id.ends_with("load")       ? 0.2
                                                      : 0.5;
    const bool from_zero = id.ends_with("time") || id.ends_with("load");
    s.parameters["low"] = {from_zero ? 0.0 : -1.1 * reach};
    s.parameters["high"] = {reach};
  }
  return s;
}

// x and v of the mass, and what the four mechanical channels read.
template <class T>
std::array<T, 6> run_for_half_a_second(const Model& model, const Rig& rig,
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
  const ReadingFaults<T> faults(n.reading, bank, h);
  SensorMemory<T> chains;
  FaultMemory<T> memory;
  bank.settle(chains, rig.quantities(state, input(0.0), n));
  faults.settle(memory, chains);
  for (int k = 0; k < 2000; ++k) {
    rig.step(state, input(k * h), input((k + 1) * h), k * h, h, n);
    bank.advance(chains, rig.quantities(state, input((k + 1) * h), n));
    faults.advance(memory, chains);
  }
  const Readings<T> r = faults.readings(memory, chains, 0.5);
  return {state.s[state::x], state.s[state::v], r.displacement,
          r.velocity,        r.friction_force,  r.normal_load};
}

TEST_P(EveryEffect, HasDerivativesThatAgreeWithDifferencesAndIsFelt) {
  const std::string id(GetParam()->card().id);
  const Setting setting = setting_for(id);
  ASSERT_FALSE(setting.parameters.empty()) << "give the new effect a setting here";
  const Place& place = setting.place;
  EXPECT_TRUE(can_be_missing(*GetParam(), setting.model, place));
  Model model = setting.model;
  model.terms.push_back({id, place.channel, setting.parameters, place.from});
  ASSERT_TRUE(inconsistencies_of(model).empty()) << inconsistencies_of(model).front().message;
  EXPECT_FALSE(can_be_missing(*GetParam(), model, place)) << "a model that has it cannot miss it";
  const Rig rig(model);
  const auto& values = rig.parameter_values();

  const auto plain = run_for_half_a_second(model, rig, values);
  for (std::size_t i = 0; i < values.size(); ++i) {
    // Where the knots of a drawn shape stand is never fitted.
    const std::string& path = rig.parameter_paths()[i];
    if (path.find("_over_") != std::string::npos &&
        (path.ends_with(".low") || path.ends_with(".high"))) {
      continue;
    }
    std::vector<Dual> duals(values.begin(), values.end());
    duals[i].d[0] = 1.0;
    const auto exact = run_for_half_a_second(model, rig, duals);
    for (std::size_t s = 0; s < exact.size(); ++s) {
      EXPECT_NEAR(exact[s].a, plain[s], 1.0e-12) << "number " << s;
    }
    const double step = 1.0e-5 * std::max(std::abs(values[i]), 1.0e-6);
    auto up = values;
    auto down = values;
    up[i] += step;
    down[i] -= step;
    const auto high = run_for_half_a_second(model, rig, up);
    const auto low = run_for_half_a_second(model, rig, down);
    for (std::size_t s = 0; s < exact.size(); ++s) {
      const double difference = (high[s] - low[s]) / (2.0 * step);
      const double scale = std::abs(plain[s]) / std::max(std::abs(values[i]), 1.0e-6);
      EXPECT_NEAR(exact[s].d[0], difference, 2.0e-4 * scale + 3.0e-3 * std::abs(difference))
          << rig.parameter_paths()[i] << ", number " << s;
    }
  }

  const Rig without(setting.model);
  const auto other = run_for_half_a_second(setting.model, without, without.parameter_values());
  double felt = 0.0;
  for (std::size_t s = 0; s < plain.size(); ++s) felt += std::abs(other[s] - plain[s]);
  EXPECT_GT(felt, 1.0e-6);
}

INSTANTIATE_TEST_SUITE_P(Catalogue, EveryEffect,
                         testing::ValuesIn(catalogue().begin(), catalogue().end()),
                         [](const auto& info) { return std::string(info.param->card().id); });

TEST(Catalogue, FindsEveryEffectByItsIdAndNoOther) {
  std::set<std::string_view> ids;
  for (const Effect* effect : catalogue()) {
    EXPECT_EQ(find_effect(effect->card().id), effect);
    EXPECT_TRUE(ids.insert(effect->card().id).second);
  }
  EXPECT_GE(ids.size(), contract().size());
  for (const auto& [id, entry] : contract()) EXPECT_TRUE(ids.contains(id)) << id;
  EXPECT_EQ(find_effect("unlisted"), nullptr);
}

TEST(Catalogue, KnowsWhatAModelCannotLack) {
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
  EXPECT_FALSE(missing("load_dependent_mu", coulomb));
  EXPECT_TRUE(missing("load_dependent_mu", wedge));
  EXPECT_TRUE(missing("wedge_load", coulomb));
  EXPECT_FALSE(missing("wedge_load", wedge));

  // A term opens the door to others: friction that was found may then have a memory.
  none.terms.push_back({"dry_friction", {}, {{"friction_force_n", {0.1}}}});
  EXPECT_TRUE(missing("friction_memory", none));
  EXPECT_FALSE(missing("dry_friction", none));
}

}  // namespace
}  // namespace stickslip::physics
