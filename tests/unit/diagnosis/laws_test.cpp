// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/laws.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>

#include "diagnosis/report/laws_page.h"
#include "physics/friction_laws.h"
#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

physics::Model coulomb() {
  physics::Model model = test::driven_mass();
  model.friction = {physics::FrictionLaw::coulomb, {0.6}, {0.004}, {}};
  return model;
}

const FittedLaw& law(const LawComparison& comparison, const std::string& id) {
  return *std::find_if(comparison.laws.begin(), comparison.laws.end(),
                       [&](const FittedLaw& each) { return each.id == id; });
}

// A law with more parameters imitates Coulomb's: it is not preferred, and its numbers that the
// recording does not show are not taken for known.
TEST(Laws, ARicherLawIsNotPreferredWhereCoulombsHolds) {
  Options options;
  options.threads = 2;
  physics::Model declared = coulomb();
  declared.friction.mu = {0.5, 0.2};
  const LawComparison found = compare_laws({test::record(coulomb(), 24.0)}, declared, options);
  ASSERT_EQ(found.laws.size(), 1 + physics::friction_laws().size());
  EXPECT_EQ(found.laws.front().id, "coulomb") << found.conclusion;
  EXPECT_TRUE(law(found, "none").distinguished);
  EXPECT_FALSE(law(found, "stribeck").distinguished);
  for (const FittedLaw& each : found.laws) {
    EXPECT_LT(each.over_first.value, 2.0 * each.over_first.se + 1.0e-9) << each.id;
    EXPECT_EQ(each.separating_run.has_value(), !each.distinguished && each.id != "coulomb")
        << each.id;
  }
  const Estimate& mu = found.laws.front().parameters.front();
  EXPECT_LT(mu.low, 0.6);
  EXPECT_GT(mu.high, 0.6);
  EXPECT_EQ(found.laws.front().model.friction.law, physics::FrictionLaw::coulomb);
  const std::string text = report::laws_text(found);
  EXPECT_NE(text.find("It does not distinguish it from"), std::string::npos) << text;
}

// A law by name is declared physics like any other: its numbers are calibrated, and nothing is
// missing where it holds.
TEST(Laws, ADeclaredLawIsCalibrated) {
  physics::Model truth = test::driven_mass();
  physics::Term lugre;
  lugre.id = "lugre";
  lugre.law = true;
  lugre.parameters = {{"mu", {0.6}},
                      {"mu_static", {0.8}},
                      {"stribeck_speed_m_s", {0.02}},
                      {"stiffness_n_m", {3000.0}}};
  truth.terms = {lugre};
  physics::Model declared = truth;
  declared.terms.front().parameters["mu"] = {0.5, 0.2};
  declared.terms.front().parameters["stiffness_n_m"] = {2000.0, 2000.0};
  Options options;
  options.threads = 2;
  const Diagnosis found = diagnose({test::record(truth, 24.0)}, declared, options);
  EXPECT_EQ(found.verdict, Verdict::consistent);
  for (const auto& [path, value] :
       {std::pair{"friction.mu", 0.6}, {"friction.stiffness_n_m", 3000.0}}) {
    const auto each = std::find_if(found.calibrated.begin(), found.calibrated.end(),
                                   [path = path](const Calibration& c) { return c.path == path; });
    ASSERT_NE(each, found.calibrated.end()) << path;
    EXPECT_LT(each->low, value) << path;
    EXPECT_GT(each->high, value) << path;
    EXPECT_LT(each->high - each->low, 0.5 * value) << path;
  }
}

}  // namespace
}  // namespace stickslip::diagnosis
