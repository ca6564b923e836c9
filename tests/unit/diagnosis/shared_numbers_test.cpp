// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "diagnosis/hypothesis.h"
#include "physics/catalogue.h"
#include "tests/unit/diagnosis/bench.h"
#include "tests/unit/diagnosis/campaigns.h"

namespace stickslip::diagnosis {
namespace {

using physics::SharedNumber;
using physics::Sharing;
using test::driven_mass;
using test::experiment_of;
using test::record;
using test::under_loads;
using test::with_term;

constexpr const char* stiffness = "oscillator.stiffness_n_m";
constexpr const char* friction = "physics.dry_friction.friction_force_n";

Hypothesis shared(const physics::Model& model, const physics::Campaign& campaign) {
  return Hypothesis(model, std::make_shared<physics::Campaign>(campaign));
}

std::size_t index_of_path(const Hypothesis& hypothesis, const std::string& path) {
  const auto& paths = hypothesis.rig().parameter_paths();
  return static_cast<std::size_t>(std::find(paths.begin(), paths.end(), path) - paths.begin());
}

double number_in(const Hypothesis& hypothesis, const std::string& path,
                 const std::vector<double>& z, std::size_t recording) {
  return hypothesis.parameters(z, recording)[index_of_path(hypothesis, path)];
}

TEST(SharedNumbers, OwnOnesAreAsManyAsTheRecordings) {
  const auto hypothesis =
      shared(driven_mass(), under_loads({1.0, 2.0}, {{stiffness, Sharing::own}}));
  ASSERT_EQ(hypothesis.unknowns().size(), 3U);  // damping is common
  const std::vector<double> z{1.0, -1.0, 0.0};
  EXPECT_DOUBLE_EQ(number_in(hypothesis, stiffness, z, 0), 163.0);
  EXPECT_DOUBLE_EQ(number_in(hypothesis, stiffness, z, 1), 153.0);
  EXPECT_DOUBLE_EQ(hypothesis.model_at(z).oscillator.stiffness_n_m->value, 158.0);
  EXPECT_FALSE(hypothesis.acts(0, 1));
  EXPECT_TRUE(hypothesis.acts(2, 1));
}

TEST(SharedNumbers, ZerosOfSensorsAreEachRecordingsOwnUnlessTheFileSaysOtherwise) {
  const physics::Campaign campaign = under_loads({1.0, 2.0});
  EXPECT_EQ(campaign.sharing_of("sensors.displacement.offset").sharing, Sharing::own);
  EXPECT_EQ(campaign.sharing_of("sensors.displacement.gain").sharing, Sharing::common);
  const auto common = campaign.with({"sensors.displacement.offset", Sharing::common});
  EXPECT_EQ(common.sharing_of("sensors.displacement.offset").sharing, Sharing::common);
}

TEST(SharedNumbers, FollowTheirCondition) {
  const physics::Effect& effect = *physics::find_effect("dry_friction");
  const auto with_friction = [&](Sharing sharing) {
    return shared(driven_mass(), under_loads({1.0, 4.0}, {{friction, sharing, "load_n"}}))
        .with(effect, {}, std::vector<double>{0.5}, std::vector<double>{0.01}, Detail::coarse);
  };
  const Hypothesis proportional = with_friction(Sharing::proportional);
  std::vector<double> z(proportional.unknowns().size(), 0.0);
  EXPECT_NEAR(number_in(proportional, friction, z, 0), 0.25, 1.0e-12);  // at 2 N it is 0.5 N
  EXPECT_NEAR(number_in(proportional, friction, z, 1), 1.0, 1.0e-12);
  const Hypothesis power = with_friction(Sharing::power);
  ASSERT_EQ(power.unknowns().size(), proportional.unknowns().size() + 1);
  z.push_back(0.5);  // its exponent
  EXPECT_NEAR(number_in(power, friction, z, 1) / number_in(power, friction, z, 0), 2.0, 1.0e-12);
  physics::Run between;
  between.conditions["load_n"] = 2.0;
  EXPECT_NEAR(power.model_at(z, between).terms[0].parameters.at("friction_force_n").value, 0.5,
              1.0e-12);
}

TEST(SharedNumbers, SettingsAreThoseOfTheirRecording) {
  physics::Model model = driven_mass();
  model.normal_load = physics::NormalLoad{physics::NormalLoadLaw::constant, {2.0, 0.02}, {}};
  physics::Campaign campaign = under_loads({1.0, 4.0});
  campaign.runs[1].settings["oscillator.mass_kg"] = 1.5;
  const auto hypothesis = shared(model, campaign);
  std::vector<double> z(hypothesis.unknowns().size(), 0.0);
  EXPECT_DOUBLE_EQ(number_in(hypothesis, "oscillator.mass_kg", z, 0), 1.0);
  EXPECT_DOUBLE_EQ(number_in(hypothesis, "oscillator.mass_kg", z, 1), 1.5);
  // The load is known to 1 % in either.
  const auto load = hypothesis.unknown_of(index_of_path(hypothesis, "normal_load.load_n"));
  z[*load] = 1.0;
  EXPECT_DOUBLE_EQ(number_in(hypothesis, "normal_load.load_n", z, 0), 1.01);
  EXPECT_DOUBLE_EQ(number_in(hypothesis, "normal_load.load_n", z, 1), 4.04);
}

TEST(SharedNumbers, KeepTheirValuesWhenTheSharingChanges) {
  const auto common = shared(driven_mass(), under_loads({1.0, 2.0}));
  const std::vector<double> z{0.5, -0.5};
  const Hypothesis own = common.sharing({stiffness, Sharing::own});
  const auto carried = carried_over(common, z, own);
  for (const std::size_t recording : {0U, 1U}) {
    EXPECT_NEAR(number_in(own, stiffness, carried, recording),
                number_in(common, stiffness, z, recording), 1.0e-9);
  }
  const Hypothesis freed = own.freeing(index_of_path(own, stiffness));
  EXPECT_EQ(freed.unknowns().size(), 3U);
  EXPECT_NEAR(number_in(freed, stiffness, carried_over(own, carried, freed), 1),
              number_in(common, stiffness, z, 1), 1.0e-9);
}

TEST(SharedNumbers, HaveTheDerivativesOfTheirReadings) {
  const physics::Model truth =
      with_term(driven_mass(), "dry_friction",
                {{"friction_force_n", {0.4}}, {"transition_speed_m_s", {0.02}}});
  std::vector<Experiment> experiments;
  for (std::size_t i = 0; i < 2; ++i) {
    experiments.push_back(experiment_of(record(truth, 6.0, i + 1), driven_mass()));
    experiments.back().recording = i;
  }
  experiments[1].noise_ratio.fill(0.5);
  Task task = test::all_windows(experiments);
  task.windows = {{0, 3}, {1, 3}};
  task.steps = Steps::coarse;
  const auto hypothesis =
      shared(driven_mass(), under_loads({1.0, 4.0}, {{friction, Sharing::power, "load_n"},
                                                     {stiffness, Sharing::varies},
                                                     {"oscillator.damping_n_s_m", Sharing::own}}))
          .with(*physics::find_effect("dry_friction"), {}, std::vector<double>{0.4},
                std::vector<double>{0.02}, Detail::coarse);
  std::vector<double> z(hypothesis.unknowns().size(), 0.1);
  ASSERT_EQ(z.size(), 3U + 2U + 2U);
  const auto states = initial_states(task, hypothesis);
  const auto jacobian = jacobians_of(task, hypothesis, z, states);
  for (std::size_t w = 0; w < 2; ++w) {
    for (std::size_t u = 0; u < z.size(); ++u) {
      SCOPED_TRACE(std::to_string(w) + ", unknown " + std::to_string(u));
      const auto at = [&](double amount) {
        std::vector<double> moved = z;
        moved[u] += amount;
        return residuals_of(task, w, hypothesis, moved, states[w]);
      };
      constexpr double amount = 1.0e-4;
      const Eigen::VectorXd expected = (at(amount) - at(-amount)) / (2.0 * amount);
      const auto column = jacobian[w].parameters.col(static_cast<Eigen::Index>(u));
      EXPECT_LT((column - expected).norm(), 0.01 * expected.norm() + 1.0e-3);
      EXPECT_EQ(expected.norm() > 0.0, hypothesis.acts(u, w));
    }
  }
}

}  // namespace
}  // namespace stickslip::diagnosis
