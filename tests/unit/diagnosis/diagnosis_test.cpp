#include "diagnosis/diagnosis.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "diagnosis/report/json.h"
#include "diagnosis/report/text.h"
#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using report::report_json;
using report::report_text;

using test::driven_mass;
using test::record;
using test::with_term;

Diagnosis diagnosed(const physics::Model& truth, int threads = 2, std::uint64_t noise_seed = 1) {
  Options options;
  options.threads = threads;
  return diagnose({record(truth, 24.0, noise_seed)}, driven_mass(), options);
}

/// An effect that the model lacks, with the parameter that the diagnosis should find.
struct Concealed {
  const char* id;
  const char* parameter;
  double value;
  physics::Relation relation;
};

class OneEffect : public ::testing::TestWithParam<Concealed> {};

TEST_P(OneEffect, IsNamedWithItsParameterAndExplainsTheMismatch) {
  const Concealed& hidden = GetParam();
  const auto truth = with_term(driven_mass(), hidden.id, {{hidden.parameter, {hidden.value}}});
  const Diagnosis got = diagnosed(truth);
  EXPECT_EQ(name_of(got.verdict), "missing_physics");
  ASSERT_EQ(got.findings.size(), 1U) << report_text(got);
  const Finding& finding = got.findings[0];
  EXPECT_EQ(finding.effect->card().id, hidden.id) << report_text(got);
  EXPECT_GT(finding.probability, 0.9);
  ASSERT_FALSE(finding.parameters.empty());  // refinements may follow
  const Estimate& estimate = finding.parameters[0];
  EXPECT_EQ(estimate.name, hidden.parameter);
  EXPECT_NEAR(estimate.value, hidden.value, 0.05 * std::abs(hidden.value));
  // Twice the 95 % interval, for a test that holds for any seed.
  const double slack = estimate.high - estimate.low;
  EXPECT_GT(hidden.value, estimate.low - 0.5 * slack);
  EXPECT_LT(hidden.value, estimate.high + 0.5 * slack);
  ASSERT_TRUE(got.augmented.has_value());
  EXPECT_LT(got.augmented->chi2_per_sample, 1.2);
  EXPECT_GT(got.baseline.chi2_per_sample, 2.0);
  ASSERT_TRUE(got.location.has_value());
  EXPECT_EQ(got.location->relation, hidden.relation);
  ASSERT_EQ(got.model.terms.size(), 1U);
  EXPECT_EQ(got.model.terms[0].id, hidden.id);
}

INSTANTIATE_TEST_SUITE_P(
    Catalogue, OneEffect,
    ::testing::Values(
        Concealed{"dry_friction", "friction_force_n", 0.4, physics::Relation::friction_law},
        Concealed{"bias_force", "force_n", 0.3, physics::Relation::force_balance},
        Concealed{"cubic_stiffness", "k3_n_m3", 4000.0, physics::Relation::force_balance},
        Concealed{"quadratic_drag", "drag_n_s2_m2", 1.0, physics::Relation::force_balance}),
    [](const auto& info) { return std::string(info.param.id); });

// A delay of the drive; with one compared channel equivalent to an advance of the displacement.
TEST(Diagnosis, FindsADelayOfTheDrive) {
  auto truth = driven_mass();
  truth.terms.push_back({"channel_delay", Channel::drive_force, {{"delay_s", {0.012}}}});
  const Diagnosis got = diagnosed(truth);
  EXPECT_EQ(name_of(got.verdict), "missing_physics");
  ASSERT_EQ(got.findings.size(), 1U) << report_text(got);
  EXPECT_EQ(got.findings[0].effect->card().id, "channel_delay") << report_text(got);
  ASSERT_EQ(got.findings[0].parameters.size(), 1U);
  EXPECT_NEAR(std::abs(got.findings[0].parameters[0].value), 0.012, 6.0e-4);
  EXPECT_LT(got.augmented->chi2_per_sample, 1.2);
}

// An effect of twice its detection limit is named, one far below it is not.
TEST(Diagnosis, DetectionLimitsPredictWhatIsNamed) {
  const Diagnosis clean = diagnosed(driven_mass());
  double limit = 0.0;
  for (const DetectionLimit& each : clean.detection.limits) {
    if (each.candidate.name() == "quadratic_drag") limit = each.value;
  }
  ASSERT_GT(limit, 0.0);
  const auto with_drag = [&](double times) {
    return diagnosed(
        with_term(driven_mass(), "quadratic_drag", {{"drag_n_s2_m2", {times * limit}}}));
  };
  const Diagnosis plain = with_drag(2.0);
  ASSERT_EQ(plain.findings.size(), 1U) << report_text(plain);
  EXPECT_EQ(plain.findings[0].effect->card().id, "quadratic_drag");
  EXPECT_TRUE(with_drag(0.3).findings.empty());
}

TEST(Diagnosis, IsConsistentForTheDeclaredModel) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const Diagnosis got = diagnosed(driven_mass(), 2, seed);
    EXPECT_EQ(name_of(got.verdict), "consistent") << report_text(got);
    EXPECT_TRUE(got.findings.empty());
    EXPECT_FALSE(got.augmented.has_value());
    EXPECT_NEAR(got.baseline.chi2_per_sample, 1.0, 0.1);
  }
}

// Parameters that differ from their declared values within their uncertainty are not missing
// physics.
TEST(Diagnosis, CalibratesBeforeAddingEffects) {
  auto truth = driven_mass();
  truth.oscillator.stiffness_n_m = physics::Parameter{164.0};
  truth.oscillator.damping_n_s_m = physics::Parameter{0.7};
  const Diagnosis got = diagnosed(truth);
  EXPECT_EQ(name_of(got.verdict), "consistent") << report_text(got);
  ASSERT_EQ(got.calibrated.size(), 2U);
  EXPECT_EQ(got.calibrated[0].path, "oscillator.stiffness_n_m");
  EXPECT_NEAR(got.calibrated[0].value, 164.0, 0.5);
}

TEST(Diagnosis, RefusesInvalidCriteria) {
  Options options;
  options.criteria.claim_z = -1.0;
  EXPECT_THROW(diagnose({record(driven_mass(), 24.0)}, driven_mass(), options),
               std::invalid_argument);
}

TEST(Diagnosis, DoesNotDependOnTheNumberOfThreads) {
  const auto truth = with_term(driven_mass(), "dry_friction", {{"friction_force_n", {0.4}}});
  EXPECT_EQ(report_json(diagnosed(truth, 1)).dump(), report_json(diagnosed(truth, 2)).dump());
}

}  // namespace
}  // namespace stickslip::diagnosis
