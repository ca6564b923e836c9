// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/many_starts.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

// At 20 Hz, with eight periods in a window: the declared uncertainty of the stiffness is two of
// them.
physics::Model ringing_mass() {
  physics::Model model = test::driven_mass();
  model.oscillator.stiffness_n_m = physics::Parameter{15800.0, 8000.0};
  return model;
}

// Blows of 20 ms, after which the mass rings.
double blows_n(double time_s) {
  return 10.0 * std::exp(-std::pow((std::fmod(time_s, 0.7) - 0.1) / 0.02, 2));
}

// The declared model fitted to a recording of a mass on such a spring.
Fit fitted(double stiffness_n_m, bool from_many) {
  physics::Model actual = ringing_mass();
  actual.oscillator.stiffness_n_m = physics::Parameter{stiffness_n_m};
  const auto recording = test::record(actual, 12.0, 1, true, blows_n);
  const std::vector<Experiment> experiments{test::experiment_of(recording, ringing_mass())};
  const Task task = test::all_windows(experiments);
  const Hypothesis hypothesis(ringing_mass());
  const std::vector<double> declared(hypothesis.unknowns().size(), 0.0);
  const auto states = initial_states(task, hypothesis);
  return from_many ? fit_from_many_starts(task, hypothesis, declared, states, 1, {})
                   : fit(task, hypothesis, declared, states, {});
}

TEST(ManyStarts, FindTheNumberOfPeriodsInAWindow) {
  for (const double stiffness : {5000.0, 15800.0, 27000.0}) {
    EXPECT_NEAR(fitted(stiffness, true).chi2_per_sample(), 1.0, 0.1) << stiffness;
  }
}

TEST(ManyStarts, AreNeededWhereTheDeclaredStiffnessHasAnotherNumber) {
  EXPECT_GT(fitted(5000.0, false).chi2_per_sample(), 2.0);
}

}  // namespace
}  // namespace stickslip::diagnosis
