// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/detection.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "diagnosis/residual_features.h"
#include "physics/catalogue.h"
#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using test::driven_mass;
using test::experiment_of;
using test::record;

const double share = Criteria{}.detection_chi2;

// Detection limits of a recording of the declared rig.
struct Bench {
  std::vector<Experiment> experiments{experiment_of(record(driven_mass(), 24.0), driven_mass())};
  Task task = test::all_windows(experiments);
  Hypothesis declared{driven_mass()};
  Fit fitted = test::with_fitted_states(task, declared);

  Detection detection(const std::vector<CandidateEffect>& candidates) const {
    return detection_limits(task, declared, fitted, candidates,
                            [this](const physics::Place& place) {
                              return scales_of(experiments, declared, fitted.z, {}, place);
                            },
                            {});
  }
};

CandidateEffect effect(const char* id, std::optional<Channel> channel = std::nullopt) {
  return {physics::find_effect(id), {channel, std::nullopt}};
}

TEST(Detection, AtItsLimitAnEffectRaisesChiSquaredByTheClaimedShare) {
  const Bench bench;
  const Detection detection = bench.detection({effect("cubic_stiffness")});
  ASSERT_EQ(detection.limits.size(), 1U);
  EXPECT_EQ(detection.limits[0].parameter().name, "k3_n_m3");
  const double k3 = detection.limits[0].value;
  // Ten times that size raises chi-squared by a hundred times the share.
  const auto truth = test::with_term(driven_mass(), "cubic_stiffness", {{"k3_n_m3", {10.0 * k3}}});
  const std::vector<Experiment> experiments{experiment_of(record(truth, 24.0), driven_mass())};
  const Task task = test::all_windows(experiments);
  const Fit fitted = fit(task, bench.declared, {0.0, 0.0}, initial_states(task, bench.declared));
  double samples = 0.0;
  double chi2 = 0.0;
  for (std::size_t w = 0; w < fitted.chi2.size(); ++w) {
    samples += fitted.count[w];
    chi2 += fitted.chi2[w] - (fitted.count[w] - fitted.states_per_window);
  }
  EXPECT_NEAR(chi2 / samples, 100.0 * share, 30.0 * share);
}

// The gain of a step towards an effect measures its presence in the residuals.
TEST(Detection, GainMeasuresAnEffectInTheResiduals) {
  Bench bench;
  const double k3 = bench.detection({effect("cubic_stiffness")}).limits.at(0).value;
  EXPECT_LT(bench.detection({effect("cubic_stiffness")}).limits.at(0).gain, 0.01);
  const auto truth = test::with_term(driven_mass(), "cubic_stiffness", {{"k3_n_m3", {2.0 * k3}}});
  bench.experiments = {experiment_of(record(truth, 24.0), driven_mass())};
  bench.task = test::all_windows(bench.experiments);
  bench.fitted =
      fit(bench.task, bench.declared, {0.0, 0.0}, initial_states(bench.task, bench.declared));
  const Detection detection = bench.detection({effect("cubic_stiffness"), effect("dry_friction")});
  EXPECT_NEAR(detection.limits.at(0).gain, 4.0 * share, 0.8 * share);
  EXPECT_LT(detection.limits.at(1).gain, 0.5 * detection.limits.at(0).gain);
}

TEST(Detection, LimitsAreProportionalToTheNoise) {
  Bench bench;
  const double before = bench.detection({effect("quadratic_drag")}).limits.at(0).value;
  for (double& sigma : bench.task.sigma) sigma *= 0.1;
  const double after = bench.detection({effect("quadratic_drag")}).limits.at(0).value;
  EXPECT_NEAR(after, 0.1 * before, 0.02 * before);
}

// On a linear rig a gain error of the displacement is equivalent to one of the drive force.
TEST(Detection, ListsInseparableEffects) {
  const Bench bench;
  const Detection detection =
      bench.detection({effect("gain_error", Channel::displacement), effect("quadratic_drag"),
                       effect("gain_error", Channel::drive_force)});
  ASSERT_EQ(detection.limits.size(), 3U);
  ASSERT_EQ(detection.inseparable.size(), 1U);
  EXPECT_EQ(detection.inseparable[0].one, 0U);
  EXPECT_EQ(detection.inseparable[0].other, 2U);
  EXPECT_GT(detection.inseparable[0].cosine, 0.99);
}

TEST(Detection, OmitsEffectsThatReplaceALaw) {
  Bench bench;
  auto model = driven_mass();
  model.friction.law = physics::FrictionLaw::coulomb;
  model.friction.mu = {0.2};
  model.friction.transition_speed_m_s = {0.01};
  bench.declared = Hypothesis(model);
  bench.fitted = test::with_fitted_states(bench.task, bench.declared);
  const Detection detection =
      bench.detection({effect("friction_memory"), effect("contact_compliance")});
  EXPECT_TRUE(detection.limits.empty());
}

}  // namespace
}  // namespace stickslip::diagnosis
