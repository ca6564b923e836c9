// SPDX-License-Identifier: Apache-2.0
#include "physics/model.h"
#include "physics/model_consistency.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <set>
#include <string>

#include "physics/rig.h"
#include "tests/unit/physics/rigs.h"

namespace stickslip::physics {
namespace {

struct Case {
  const char* name;
  std::function<void(Model&)> apply;
  const char* path;  ///< of the first inconsistency
};

class ModelConsistency : public testing::TestWithParam<Case> {};

TEST_P(ModelConsistency, ReportsThePathOfAnInconsistency) {
  Model model = test::bench();
  ASSERT_TRUE(inconsistencies_of(model).empty());
  GetParam().apply(model);
  const auto found = inconsistencies_of(model);
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found.front().path, GetParam().path);
  EXPECT_FALSE(found.front().message.empty());
  EXPECT_THROW(Rig{model}, std::invalid_argument);
}

INSTANTIATE_TEST_SUITE_P(
    Inconsistencies, ModelConsistency,
    testing::Values(
        Case{"more_terms_than_a_rig_has_room_for",
             [](Model& m) {
               for (const char* stem : {"displacement", "velocity", "friction_force"}) {
                 for (const char* id : {"gain_error", "channel_delay", "sensor_drift"}) {
                   Term term;
                   term.id = id;
                   term.channel = channel_named(stem);
                   m.terms.push_back(term);
                 }
               }
             },
             "physics"},
        Case{"zero_mass", [](Model& m) { m.oscillator.mass_kg = {0.0}; }, "oscillator.mass_kg"},
        Case{"mass_not_a_number", [](Model& m) { m.oscillator.mass_kg = {std::nan("")}; },
             "oscillator.mass_kg"},
        Case{"negative_sigma", [](Model& m) { m.friction.mu.sigma = -0.1; }, "friction.mu"},
        Case{"infinite_sigma",
             [](Model& m) { m.friction.mu.sigma = std::numeric_limits<double>::infinity(); },
             "friction.mu"},
        Case{"no_stiffness", [](Model& m) { m.oscillator.natural_frequency_hz.reset(); },
             "oscillator"},
        Case{"stiffness_twice", [](Model& m) { m.oscillator.stiffness_n_m = Parameter{10.0}; },
             "oscillator.stiffness_n_m"},
        Case{"no_damping", [](Model& m) { m.oscillator.damping_ratio.reset(); }, "oscillator"},
        Case{"damping_twice", [](Model& m) { m.oscillator.damping_n_s_m = Parameter{0.1}; },
             "oscillator.damping_n_s_m"},
        Case{"damping_ratio_without_stiffness",
             [](Model& m) {
               m.oscillator.natural_frequency_hz.reset();
               m.oscillator.stiffness_n_m = Parameter{0.0};
             },
             "oscillator.damping_ratio"},
        Case{"imposed_motion_with_a_spring",
             [](Model& m) {
               m.load_cell.reset();
               m.oscillator.excitation = Excitation::imposed;
             },
             "oscillator"},
        Case{"imposed_motion_with_a_load_cell",
             [](Model& m) {
               m.oscillator = {};
               m.oscillator.excitation = Excitation::imposed;
             },
             "load_cell"},
        Case{"two_well_without_linear_term",
             [](Model& m) {
               m.oscillator.two_well = TwoWell{{0.0}, {1.0e5}};
             },
             "oscillator.two_well.linear_n_m"},
        Case{"negative_load", [](Model& m) { m.normal_load->load_n = {-1.0}; },
             "normal_load.load_n"},
        Case{"negative_mu", [](Model& m) { m.friction.mu = {-0.1}; }, "friction.mu"},
        Case{"negative_transition_speed",
             [](Model& m) { m.friction.transition_speed_m_s = {-1.0}; },
             "friction.transition_speed_m_s"},
        Case{"state_variable_without_rate",
             [](Model& m) { m.friction.law = FrictionLaw::state_variable; }, "friction.rate_per_s"},
        Case{"load_cell_without_mass", [](Model& m) { m.load_cell->mass_kg = {0.0}; },
             "load_cell.mass_kg"},
        Case{"bridge_mismatch_of_1",
             [](Model& m) {
               m.normal_load_bridge = NormalLoadBridge{1.0, 0.5, 0.0};
             },
             "normal_load_bridge.mismatch"},
        Case{"bridge_share_above_1",
             [](Model& m) {
               m.normal_load_bridge = NormalLoadBridge{0.0, 1.5, 0.0};
             },
             "normal_load_bridge.share"},
        Case{"bridge_with_a_measured_load",
             [](Model& m) {
               m.normal_load->law = NormalLoadLaw::measured;
               m.normal_load_bridge = NormalLoadBridge{};
             },
             "normal_load_bridge"},
        Case{"zero_noise", [](Model& m) { m.sensors[index_of(Channel::velocity)].noise_std = 0.0; },
             "sensors.velocity.noise_std"},
        Case{"filter_of_order_0",
             [](Model& m) {
               m.sensors[0].filters = {{FilterKind::butterworth_lowpass, 0, 25.0}};
             },
             "sensors.displacement.filters"},
        Case{"filter_without_cutoff",
             [](Model& m) {
               m.sensors[4].filters = {{FilterKind::butterworth_lowpass, 4, 0.0}};
             },
             "sensors.base_displacement.filters"},
        Case{"unknown_term",
             [](Model& m) {
               m.terms.push_back({"magic", {}, {}});
             },
             "physics.magic"},
        Case{"term_without_parameter",
             [](Model& m) {
               m.terms.push_back({"cubic_stiffness", {}, {}});
             },
             "physics.cubic_stiffness.k3_n_m3"},
        Case{"term_with_an_unknown_parameter",
             [](Model& m) {
               m.terms.push_back({"bias_force", {}, {{"force_n", {0.1}}, {"torque", {1.0}}}});
             },
             "physics.bias_force.torque"},
        Case{"term_with_a_channel",
             [](Model& m) {
               m.terms.push_back({"bias_force", Channel::velocity, {{"force_n", {0.1}}}});
             },
             "physics.bias_force.velocity"},
        Case{"term_twice",
             [](Model& m) {
               m.terms.assign(2, {"bias_force", {}, {{"force_n", {0.1}}}});
             },
             "physics.bias_force"},
        Case{"friction_term_in_a_model_with_friction",
             [](Model& m) {
               m.terms.push_back({"dry_friction", {}, {{"friction_force_n", {0.1}}}});
             },
             "physics.dry_friction"}),
    [](const auto& info) { return info.param.name; });

TEST(Parameters, HaveUniquePathsAndReferToTheModel) {
  Model model = test::bench();
  model.normal_load->law = NormalLoadLaw::wedge;
  model.terms.push_back({"cubic_stiffness", {}, {{"k3_n_m3", {1.0e4}}}});
  std::set<std::string> paths;
  for (const NamedParameter& named : parameters_of(model)) {
    EXPECT_TRUE(paths.insert(named.path).second) << named.path;
    named.parameter->value += 1.0;
  }
  EXPECT_TRUE(paths.contains("normal_load.slope_per_m"));
  EXPECT_TRUE(paths.contains("physics.cubic_stiffness.k3_n_m3"));
  EXPECT_EQ(model.oscillator.mass_kg.value, 1.06);
  EXPECT_EQ(model.terms[0].parameters["k3_n_m3"].value, 1.0e4 + 1.0);
  EXPECT_EQ(Rig(model).parameter_paths().size(), paths.size());
}

}  // namespace
}  // namespace stickslip::physics
