// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/many_starts.h"

#include <gtest/gtest.h>

#include "diagnosis/fitting.h"
#include "physics/catalogue.h"
#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

physics::Model ringing_mass() { return test::ringing_mass(8000.0); }

// The declared model fitted to a recording of a mass on such a spring.
Fit fitted(double stiffness_n_m, bool from_many) {
  physics::Model actual = ringing_mass();
  actual.oscillator.stiffness_n_m = physics::Parameter{stiffness_n_m};
  const auto recording = test::record(actual, 12.0, 1, true, test::blows_n);
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

// A recording of a mass whose stiffness is far from the declared one.
std::vector<Experiment> ringing_at_another_frequency() {
  physics::Model actual = ringing_mass();
  actual.oscillator.stiffness_n_m = physics::Parameter{5000.0};
  const auto recording = test::record(actual, 12.0, 1, true, test::blows_n);
  return {test::experiment_of(recording, ringing_mass())};
}

template <class FitOf>
FittedCandidate fitted_candidate(const SearchData& data, const Hypothesis& hypothesis,
                                 const FitOf& fit_of) {
  FittedCandidate out;
  out.candidate.effect = physics::find_effect("cubic_stiffness");
  out.hypothesis = hypothesis;
  const std::vector<double> declared(hypothesis.unknowns().size(), 0.0);
  out.fitted = fit_of(data.train, hypothesis, declared, initial_states(data.train, hypothesis));
  return out;
}

Hypothesis with_idle_effect() {
  return Hypothesis(test::with_term(ringing_mass(), "cubic_stiffness", {{"k3_n_m3", {0.0, 1.0}}}));
}

constexpr auto from_declared = [](const auto&... of) { return fit(of..., {}); };
constexpr auto from_many = [](const auto&... of) { return fit_from_many_starts(of..., 1, {}); };

// The model could have found by itself all that an effect which does nothing has led to.
TEST(Refit, LeavesALocalMinimumThatAnotherHypothesisAvoided) {
  const auto experiments = ringing_at_another_frequency();
  const SearchData data = search_data(experiments, Criteria(), 1, 1);
  FittedCandidate stuck = fitted_candidate(data, Hypothesis(ringing_mass()), from_declared);
  const FittedCandidate other = fitted_candidate(data, with_idle_effect(), from_many);
  ASSERT_GT(stuck.fitted.chi2_per_sample(), 2.0);
  EXPECT_TRUE(refit_from(data, other, stuck));
  EXPECT_NEAR(stuck.fitted.chi2_per_sample(), 1.0, 0.1);
  EXPECT_NEAR(stuck.held_out.chi2, 1.0, 0.3);
  EXPECT_FALSE(refit_from(data, other, stuck)) << "nothing more to be found";
}

TEST(Restart, LeavesALocalMinimumWhereItIsAllowedTo) {
  const auto experiments = ringing_at_another_frequency();
  const SearchData data = search_data(experiments, Criteria(), 1, 1);
  const Hypothesis declared(ringing_mass());
  std::vector<FittedCandidate> candidates{
      fitted_candidate(data, with_idle_effect(), from_declared)};
  FittedCandidate& stuck = candidates.front();
  const auto score = [&] {
    stuck.held_out = held_out_score(data.held_out, *stuck.hypothesis, stuck.fitted.z, true);
    return stuck.held_out.chi2;
  };
  ASSERT_GT(score(), 2.0);
  const FittedCandidate before = stuck;
  restart_best(data, declared, before, candidates, [](const FittedCandidate&) { return false; });
  EXPECT_GT(score(), 2.0);
  EXPECT_FALSE(is_near_noise(candidates, data.criteria));
  restart_best(data, declared, before, candidates, [](const FittedCandidate&) { return true; });
  EXPECT_NEAR(score(), 1.0, 0.3);
  EXPECT_TRUE(is_near_noise(candidates, data.criteria));
}

TEST(ManyStarts, AreNeededWhereTheDeclaredStiffnessHasAnotherNumber) {
  EXPECT_GT(fitted(5000.0, false).chi2_per_sample(), 2.0);
}

}  // namespace
}  // namespace stickslip::diagnosis
