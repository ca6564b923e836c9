#include "physics/effects/catalogue.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <string>
#include <vector>

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
  ASSERT_NE(entry, contract().end());
  EXPECT_EQ(card.relation, entry->second.relation);
  std::vector<std::string> estimated;
  for (const ParameterCard& parameter : card.parameters) {
    if (!parameter.fixed_default) estimated.emplace_back(parameter.name);
  }
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
    EXPECT_TRUE(contract().contains(std::string(rival))) << rival;
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
                      .sample_period_s = 1.0e-3};
  std::size_t estimated = 0;
  std::size_t fixed = 0;
  for (const ParameterCard& parameter : effect.card().parameters) {
    ++(parameter.fixed_default ? fixed : estimated);
  }
  ASSERT_FALSE(effect.starts(scales).empty());
  for (const auto& start : effect.starts(scales)) {
    ASSERT_EQ(start.size(), estimated);
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
};
Setting setting_for(const std::string& id) {
  Setting s{test::bench(), {}};
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
  return s;
}

template <class T>
RigState<T> run_for_half_a_second(const Rig& rig, const std::vector<T>& parameters) {
  const auto n = rig.numbers<T>(std::span<const T>(parameters));
  RigState<T> state;
  state.s[state::x] = T(0.004);
  const double h = 2.5e-4;
  const auto input = [](double time) {
    Input now;
    now.base_acceleration_m_s2 = -2.5 * std::cos(2.0 * std::numbers::pi * 2.9 * time);
    return now;
  };
  for (int k = 0; k < 2000; ++k) {
    rig.step(state, input(k * h), input((k + 1) * h), k * h, h, n);
  }
  return state;
}

TEST_P(EveryEffect, HasDerivativesThatAgreeWithDifferencesAndIsFelt) {
  const std::string id(GetParam()->card().id);
  const Setting setting = setting_for(id);
  ASSERT_FALSE(setting.parameters.empty()) << "give the new effect a setting here";
  EXPECT_TRUE(can_be_missing(*GetParam(), setting.model));
  Model model = setting.model;
  model.terms.push_back({id, {}, setting.parameters});
  ASSERT_TRUE(inconsistencies_of(model).empty()) << inconsistencies_of(model).front().message;
  EXPECT_FALSE(can_be_missing(*GetParam(), model)) << "a model that has it cannot miss it";
  const Rig rig(model);
  const auto& values = rig.parameter_values();
  ASSERT_LE(values.size(), static_cast<std::size_t>(Dual::directions));

  std::vector<Dual> duals(values.begin(), values.end());
  for (std::size_t i = 0; i < duals.size(); ++i) duals[i].d[static_cast<Eigen::Index>(i)] = 1.0;
  const auto exact = run_for_half_a_second(rig, duals);
  const auto plain = run_for_half_a_second(rig, values);
  for (std::size_t s = 0; s < exact.s.size(); ++s) {
    EXPECT_NEAR(exact.s[s].a, plain.s[s], 1.0e-12) << "state " << s;
  }
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double step = 1.0e-5 * std::max(std::abs(values[i]), 1.0e-6);
    auto up = values;
    auto down = values;
    up[i] += step;
    down[i] -= step;
    const auto high = run_for_half_a_second(rig, up);
    const auto low = run_for_half_a_second(rig, down);
    for (const auto s : {static_cast<std::size_t>(state::x), static_cast<std::size_t>(state::v)}) {
      const double difference = (high.s[s] - low.s[s]) / (2.0 * step);
      const double scale = std::abs(plain.s[s]) / std::max(std::abs(values[i]), 1.0e-6);
      EXPECT_NEAR(exact.s[s].d[static_cast<Eigen::Index>(i)], difference,
                  2.0e-4 * scale + 3.0e-3 * std::abs(difference))
          << rig.parameter_paths()[i] << ", state " << s;
    }
  }

  const Rig without(setting.model);
  const auto other = run_for_half_a_second(without, without.parameter_values());
  EXPECT_GT(std::abs(other.s[state::x] - plain.s[state::x]) +
                0.05 * std::abs(other.s[state::v] - plain.s[state::v]),
            1.0e-6);
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
  EXPECT_GE(ids.size(), 13U);
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
