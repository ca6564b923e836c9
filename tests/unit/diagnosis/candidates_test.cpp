// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/candidates.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "diagnosis/fitted_candidate.h"
#include "physics/catalogue.h"
#include "tests/unit/diagnosis/bench.h"
#include "tests/unit/diagnosis/campaigns.h"

namespace stickslip::diagnosis {
namespace {

using test::driven_mass;
using test::experiment_of;
using test::record;

std::vector<std::string> names_of(const std::vector<CandidateEffect>& candidates) {
  std::vector<std::string> names;
  for (const CandidateEffect& candidate : candidates) names.push_back(candidate.name());
  return names;
}

bool holds(const std::vector<std::string>& names, const char* name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

TEST(CandidateEffects, AreMissingFromTheModelAndVisibleInTheChannels) {
  const std::vector<Experiment> experiments{
      experiment_of(record(driven_mass(), 8.0), driven_mass())};
  const auto names = names_of(candidate_effects(driven_mass(), experiments));
  EXPECT_TRUE(holds(names, "dry_friction"));
  EXPECT_TRUE(holds(names, "gain_error of displacement"));
  EXPECT_TRUE(holds(names, "gain_error of drive_force"));
  EXPECT_TRUE(holds(names, "force_over_velocity"));
  EXPECT_FALSE(holds(names, "stribeck")) << "there is no friction yet";
  EXPECT_FALSE(holds(names, "gain_error of velocity")) << "it is not recorded";
  EXPECT_FALSE(holds(names, "crosstalk of displacement from velocity"));
  EXPECT_FALSE(holds(names, "load_cell_resonance"));
}

// An effect of the load shows where the load differs: in a recording, or between recordings.
TEST(CandidateEffects, OfTheLoadNeedALoadThatDiffers) {
  physics::Model model = driven_mass();
  model.friction.law = physics::FrictionLaw::coulomb;
  model.friction.mu = {0.3};
  model.friction.transition_speed_m_s = {1.0e-3};
  model.normal_load.emplace().load_n = {1.5};
  const std::vector<Experiment> experiments{experiment_of(record(model, 8.0), model)};
  const auto names = [&](const physics::Campaign* campaign) {
    return names_of(candidate_effects(model, experiments, campaign));
  };
  const physics::Campaign same = test::under_loads({1.5, 1.5});
  const physics::Campaign different = test::under_loads({1.0, 2.0});
  for (const char* id : {"load_dependent_mu", "friction_over_load"}) {
    EXPECT_FALSE(holds(names(nullptr), id)) << id;
    EXPECT_FALSE(holds(names(&same), id)) << id;
    EXPECT_TRUE(holds(names(&different), id)) << id;
  }
  model.normal_load->law = physics::NormalLoadLaw::wedge;
  model.normal_load->slope_per_m = {1.0};
  EXPECT_TRUE(holds(names(nullptr), "load_dependent_mu"));
}

double complexity_with(const char* id, const physics::Place& place) {
  FittedCandidate fitted;
  fitted.candidate.effect = physics::find_effect(id);
  fitted.candidate.place = place;
  const Hypothesis declared(driven_mass());
  fitted.hypothesis = extended(declared, fitted.candidate, std::vector{0.01}, {}, Detail::coarse);
  return complexity_of(fitted, {});
}

// A constant load that crosses into another channel reads like an offset of it: the simpler one is
// to be preferred.
TEST(Complexity, OfACrosstalkIsAboveThatOfAnOffset) {
  EXPECT_GT(complexity_with("crosstalk", {Channel::displacement, Channel::normal_load}),
            complexity_with("sensor_offset", {Channel::displacement, {}}));
}

}  // namespace
}  // namespace stickslip::diagnosis
