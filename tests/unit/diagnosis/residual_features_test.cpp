// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/residual_features.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using test::driven_mass;
using test::experiment_of;
using test::record;

// Features of the declared model's residuals in a recording of `truth`.
ResidualFeatures features_for(const physics::Model& truth) {
  const std::vector<Experiment> experiments{experiment_of(record(truth, 24.0), driven_mass())};
  const Task task = test::all_windows(experiments);
  const Hypothesis declared(driven_mass());
  const std::vector<double> z(declared.unknowns().size(), 0.0);
  FitOptions states_only;
  states_only.parameters_free = false;
  const Fit fitted = fit(task, declared, z, initial_states(task, declared), states_only);
  return residual_features(task, declared, fitted);
}

TEST(ResidualFeatures, ContainTheSpectralLineOfHum) {
  physics::Model truth = driven_mass();
  truth.terms.push_back(
      {"mains_hum",
       Channel::displacement,
       {{"frequency_hz", {50.0}}, {"amplitude", {2.0e-4}}, {"phase_rad", {0.8}}}});
  const ResidualFeatures features = features_for(truth);
  const physics::Line& line = features.line[index_of(Channel::displacement)];
  EXPECT_NEAR(line.frequency_hz, 50.0, 0.02);
  EXPECT_NEAR(line.amplitude, 2.0e-4, 3.0e-5);
  EXPECT_GT(std::cos(line.phase_rad - 0.8), 0.8);
}

TEST(ResidualFeatures, ContainStartAndEndOfAnEpisode) {
  const auto truth = test::with_term(driven_mass(), "force_episode",
                                     {{"force_n", {2.0}}, {"begin_s", {9.0}}, {"end_s", {14.0}}});
  const ResidualFeatures features = features_for(truth);
  ASSERT_FALSE(features.episodes_s.empty());
  double nearest = 10.0;
  for (const auto& [begin, end] : features.episodes_s) {
    nearest = std::min(nearest, std::abs(begin - 9.0) + std::abs(end - 14.0));
  }
  EXPECT_LT(nearest, 2.0);
}

}  // namespace
}  // namespace stickslip::diagnosis
