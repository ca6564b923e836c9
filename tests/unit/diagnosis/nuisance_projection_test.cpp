// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/nuisance_projection.h"

#include <gtest/gtest.h>

#include "physics/catalogue.h"
#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using test::driven_mass;
using test::with_term;

constexpr double k3_n_m3 = 1.0;

// The declared rig fitted to a recording with that spring, in which only the states are free yet.
struct Hardening {
  std::vector<Experiment> experiments;
  Task task;
  Hypothesis declared{driven_mass()};
  Fit fitted;
  NuisanceProjection projection;

  explicit Hardening(double k3)
      : experiments{test::experiment_of(
            test::record(with_term(driven_mass(), "cubic_stiffness", {{"k3_n_m3", {k3}}}), 24.0),
            driven_mass())},
        task(test::all_windows(experiments)),
        fitted(fit(task, declared, {0.0, 0.0}, initial_states(task, declared))),
        projection(declared, fitted.z, jacobians_of(task, declared, fitted.z, fitted.state)) {}

  Change change(double k3) const {
    const Hypothesis with =
        declared.with(*physics::find_effect("cubic_stiffness"), {}, std::vector<double>{k3}, {});
    return change_by(with, task, {&declared, fitted.z, &fitted.state}, projection);
  }
};

TEST(NuisanceProjection, OneRunShowsTheSizeOfAnEffectAndItsGain) {
  const Hardening recording(k3_n_m3);
  // A start of a fifth of the true size, and of either sign.
  for (const double start : {0.2 * k3_n_m3, -0.2 * k3_n_m3}) {
    const Change change = recording.change(start);
    const double slope = recording.projection.slope(change);
    const double square = recording.projection.product(change, change);
    EXPECT_NEAR(-slope / square * start, k3_n_m3, 0.1 * k3_n_m3);
    const Hypothesis with = recording.declared.with(*physics::find_effect("cubic_stiffness"), {},
                                                    std::vector<double>{start}, {});
    const Fit best =
        fit(recording.task, with, {0.0, 0.0, 0.0},
            warm_start_states(recording.fitted.state, recording.task, recording.declared, with));
    EXPECT_NEAR(slope * slope / square, recording.fitted.cost - best.cost,
                0.1 * (recording.fitted.cost - best.cost));
  }
}

// Two changes alike share the size.
TEST(NuisanceProjection, SeveralChangesGainTogether) {
  const Hardening recording(k3_n_m3);
  const Change change = recording.change(0.2 * k3_n_m3);
  const double slope = recording.projection.slope(change);
  const double square = recording.projection.product(change, change);
  const Response one = recording.projection.response_to({&change, 1});
  EXPECT_NEAR(one.size[0], -slope / square, 1.0e-6);
  EXPECT_NEAR(one.gain, slope * slope / square, 1.0e-6 * one.gain);
  const std::vector<Change> same = {change, change};
  const Response two = recording.projection.response_to(same);
  EXPECT_NEAR(two.size.sum(), one.size[0], 1.0e-3);
  EXPECT_NEAR(two.gain, one.gain, 1.0e-3 * one.gain);
}

TEST(NuisanceProjection, WhatTheCalibrationAbsorbsGainsNothing) {
  const Hardening nothing(0.0);
  const auto jacobians =
      jacobians_of(nothing.task, nothing.declared, nothing.fitted.z, nothing.fitted.state);
  Change of_stiffness, of_states;
  double square = 0.0;
  for (const WindowJacobian& each : jacobians) {
    of_stiffness.push_back(each.parameters.col(0));
    of_states.push_back(each.free.col(0));
    square += each.parameters.col(0).squaredNorm();
  }
  // A step by one declared standard deviation costs what its prior says, though it moves the
  // readings far beyond their noise.
  EXPECT_GT(square, 1.0e4);
  EXPECT_NEAR(nothing.projection.product(of_stiffness, of_stiffness), 1.0, 0.05);
  const double count = static_cast<double>(jacobians.size());
  EXPECT_LT(nothing.projection.product(of_states, of_states), count);
  EXPECT_NEAR(nothing.projection.slope(of_states), 0.0, 0.1 * count);
}

TEST(NuisanceProjection, AnEffectThatIsNotThereGainsWhatNoiseDoes) {
  const Hardening nothing(0.0);
  const Change change = nothing.change(0.2 * k3_n_m3);
  const double slope = nothing.projection.slope(change);
  EXPECT_LT(slope * slope / nothing.projection.product(change, change), 12.0);
}

}  // namespace
}  // namespace stickslip::diagnosis
