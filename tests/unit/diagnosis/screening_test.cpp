// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/screening.h"

#include <gtest/gtest.h>

#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using test::driven_mass;

// Names of the effects that are worth a fit on a recording of `actual`.
std::vector<std::string> screened(const physics::Model& actual) {
  const std::vector<Experiment> experiments{
      test::experiment_of(test::record(actual, 24.0), driven_mass())};
  SearchData data = search_data(experiments, Criteria(), 1, 1);
  const FittedCandidate base = calibrate(data, driven_mass());
  const ResidualFeatures features = residual_features(data.train, *base.hypothesis, base.fitted);
  std::vector<std::string> out;
  for (const FittedCandidate& each : screen(data, features, base, {}, [](auto&&, double) {})) {
    out.push_back(each.candidate.name());
  }
  return out;
}

physics::Model hardening(double k3_n_m3) {
  return test::with_term(driven_mass(), "cubic_stiffness", {{"k3_n_m3", {k3_n_m3}}});
}

TEST(Screening, FindsAnEffect) {
  const auto found = screened(hardening(5.0));
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found.front(), "cubic_stiffness");
}

// In the minimum of another number of periods, which missing physics has led a calibration to, no
// effect is found; from the declared values it is.
TEST(Screening, StartsFromTheDeclaredValuesToo) {
  const physics::Model declared = test::ringing_mass(1500.0);
  const auto actual = test::with_term(declared, "cubic_stiffness", {{"k3_n_m3", {1.0e8}}});
  const std::vector<Experiment> experiments{
      test::experiment_of(test::record(actual, 24.0, 1, true, test::blows_n), declared)};
  const SearchData data = search_data(experiments, Criteria(), 1, 1);
  FittedCandidate base;
  base.hypothesis.emplace(declared);
  std::vector<double> far;
  for (const Unknown& unknown : base.hypothesis->unknowns()) {
    const auto& path = base.hypothesis->rig().parameter_paths()[unknown.parameter];
    far.push_back(path == "oscillator.stiffness_n_m" ? 8.0 : 0.0);
  }
  base.fitted = fit_states(data.train, *base.hypothesis, far, {});
  const ResidualFeatures features = residual_features(data.train, *base.hypothesis, base.fitted);
  const auto found = screen(data, features, base, {}, [](auto&&, double) {});
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found.front().candidate.name(), "cubic_stiffness");
}

// About eighty effects are screened.
TEST(Screening, FitsLittleToACleanRecording) { EXPECT_LE(screened(driven_mass()).size(), 8U); }

}  // namespace
}  // namespace stickslip::diagnosis
