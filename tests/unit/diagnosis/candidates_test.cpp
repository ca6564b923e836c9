// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/candidates.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "diagnosis/fitted_candidate.h"
#include "physics/catalogue.h"
#include "tests/unit/diagnosis/bench.h"

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
