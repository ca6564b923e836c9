// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/hypothesis.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "physics/catalogue.h"
#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using test::driven_mass;

Hypothesis with_dry_friction(double start_n) {
  const auto* effect = physics::find_effect("dry_friction");
  const std::vector<double> start = {start_n};
  physics::Scales scales;
  return Hypothesis(driven_mass()).with(*effect, {}, start, effect->fixed(scales), Detail::coarse);
}

TEST(Hypothesis, HasOneUnknownForEveryUncertainParameter) {
  const Hypothesis hypothesis(driven_mass());
  ASSERT_EQ(hypothesis.unknowns().size(), 2U);  // stiffness and damping; the mass is exact
  for (const Unknown& unknown : hypothesis.unknowns()) {
    EXPECT_TRUE(unknown.of_model);
    EXPECT_EQ(unknown.prior_sigma, 1.0);
  }
}

TEST(Hypothesis, AtTheOriginIsTheDeclaredModel) {
  const Hypothesis hypothesis(driven_mass());
  EXPECT_EQ(hypothesis.model_at(std::vector<double>(2, 0.0)), driven_mass());
}

TEST(Hypothesis, UnknownsAreInUnitsOfTheirStandardDeviation) {
  const Hypothesis hypothesis(driven_mass());
  const auto model = hypothesis.model_at(std::vector<double>{2.0, -1.0});
  EXPECT_DOUBLE_EQ(model.oscillator.stiffness_n_m->value, 168.0);
  EXPECT_DOUBLE_EQ(model.oscillator.damping_n_s_m->value, 0.3);
}

TEST(Hypothesis, KeepsPositiveParametersAboveZero) {
  const Hypothesis hypothesis(driven_mass());
  const auto model = hypothesis.model_at(std::vector<double>{-1000.0, 0.0});
  EXPECT_GT(model.oscillator.stiffness_n_m->value, 0.0);
}

TEST(Hypothesis, UnknownsOfAnAddedTermFollowThoseOfTheModel) {
  const Hypothesis hypothesis = with_dry_friction(0.7);
  ASSERT_EQ(hypothesis.unknowns().size(), 3U);
  EXPECT_FALSE(hypothesis.unknowns()[2].of_model);
  const auto model = hypothesis.model_at(std::vector<double>(3, 0.0));
  ASSERT_EQ(model.terms.size(), 1U);
  EXPECT_DOUBLE_EQ(model.terms[0].parameters.at("friction_force_n").value, 0.7);
}

TEST(Hypothesis, ASecondEffectDoesNotChangeTheFirst) {
  const Hypothesis one = with_dry_friction(0.7);
  const auto* second = physics::find_effect("cubic_stiffness");
  const std::vector<double> start = {12.0};
  const Hypothesis two = one.with(*second, {}, start, {});
  ASSERT_EQ(two.unknowns().size(), 4U);
  const std::vector<double> z(4, 0.0);
  EXPECT_DOUBLE_EQ(two.value(2, 0.0), 0.7);
  EXPECT_DOUBLE_EQ(two.model_at(z).terms[1].parameters.at("k3_n_m3").value, 12.0);
}

TEST(Hypothesis, FreesADeclaredNumberAroundItsValue) {
  const Hypothesis declared(driven_mass());
  const auto& paths = declared.rig().parameter_paths();
  const auto index_of = [&](const char* path) {
    return static_cast<std::size_t>(std::find(paths.begin(), paths.end(), path) - paths.begin());
  };
  // Exact, and known with a standard deviation, which no longer binds it.
  for (const char* path : {"oscillator.mass_kg", "oscillator.damping_n_s_m"}) {
    const Hypothesis freed = declared.freeing(index_of(path));
    ASSERT_TRUE(freed.unknown_of(index_of(path)));
    const Unknown& unknown = freed.unknowns()[*freed.unknown_of(index_of(path))];
    EXPECT_TRUE(unknown.freed && unknown.logarithmic && !unknown.of_model) << path;
    EXPECT_EQ(&unknown, &freed.unknowns().back()) << path;
    EXPECT_EQ(freed.model_at(std::vector<double>(freed.unknowns().size(), 0.0)), driven_mass());
  }
  EXPECT_EQ(declared.freeing(index_of("oscillator.mass_kg")).unknowns().size(), 3U);
  EXPECT_EQ(declared.freeing(index_of("oscillator.damping_n_s_m")).unknowns().size(), 2U);
}

// Freed numbers move to the end: values are carried over by number, not by position.
TEST(Hypothesis, CarriesValuesOver) {
  const Hypothesis declared(driven_mass());
  const Hypothesis freed = declared.freeing(declared.unknowns()[0].parameter);
  const auto* effect = physics::find_effect("cubic_stiffness");
  const std::vector<double> start = {12.0};
  const Hypothesis more = freed.with(*effect, {}, start, {});
  const std::vector<double> z = {1.5, -0.5};
  const std::vector<double> carried = carried_over(declared, z, more);
  ASSERT_EQ(carried.size(), 3U);
  const auto before = declared.model_at(z).oscillator;
  const auto after = more.model_at(carried).oscillator;
  EXPECT_DOUBLE_EQ(after.stiffness_n_m->value, before.stiffness_n_m->value);
  EXPECT_DOUBLE_EQ(after.damping_n_s_m->value, before.damping_n_s_m->value);
}

// A number that was declared as 0 may be freed, and does not become negative.
TEST(Hypothesis, FreesZero) {
  auto model = driven_mass();
  model.oscillator.damping_n_s_m = physics::Parameter{0.0};
  const Hypothesis declared(model);
  const auto& paths = declared.rig().parameter_paths();
  const auto at = std::find(paths.begin(), paths.end(), "oscillator.damping_n_s_m");
  const Hypothesis freed = declared.freeing(static_cast<std::size_t>(at - paths.begin()));
  EXPECT_EQ(freed.value(1, -2.0), 0.0);
  EXPECT_EQ(freed.value(1, 0.3), 0.3);
}

TEST(Hypothesis, StartsWithinTheDomainOfAParameter) {
  physics::Model model = driven_mass();
  model.friction.law = physics::FrictionLaw::coulomb;
  model.friction.mu = {0.0};
  const auto* effect = physics::find_effect("contact_compliance");
  physics::Scales scales;  // of a recording without friction
  scales.friction_n = 0.0;
  for (const auto& start : effect->starts(scales)) {
    const Hypothesis hypothesis =
        Hypothesis(model).with(*effect, {}, start, effect->fixed(scales), Detail::coarse);
    EXPECT_GT(hypothesis.model().terms[0].parameters.at("contact_stiffness_n_m").value, 0.0);
  }
}

TEST(Hypothesis, SlopeIsTheDerivativeOfTheValue) {
  const Hypothesis hypothesis = with_dry_friction(0.7);
  for (std::size_t u = 0; u < hypothesis.unknowns().size(); ++u) {
    for (const double z : {-0.8, 0.0, 1.3}) {
      const double h = 1.0e-5;
      const double slope = (hypothesis.value(u, z + h) - hypothesis.value(u, z - h)) / (2.0 * h);
      EXPECT_NEAR(hypothesis.slope(u, z), slope, 1.0e-6 * (1.0 + std::abs(slope)));
    }
  }
}

TEST(Hypothesis, RefinementParametersAreLast) {
  const auto* effect = physics::find_effect("hysteresis");
  const std::vector<double> start = {5.0, 0.02, 0.3, 1.5};
  const Hypothesis coarse = Hypothesis(driven_mass()).with(*effect, {}, start, {}, Detail::coarse);
  ASSERT_EQ(coarse.unknowns().size(), 4U);  // two of the model, stiffness and slip force
  const Hypothesis all = coarse.refined();
  ASSERT_EQ(all.unknowns().size(), 6U);
  for (std::size_t u = 0; u < 4; ++u) {
    EXPECT_EQ(all.unknowns()[u].parameter, coarse.unknowns()[u].parameter);
  }
  EXPECT_EQ(all.model_at(std::vector<double>(6, 0.0)),
            coarse.model_at(std::vector<double>(4, 0.0)));
  EXPECT_EQ(all.refined().unknowns().size(), 6U);
}

}  // namespace
}  // namespace stickslip::diagnosis
