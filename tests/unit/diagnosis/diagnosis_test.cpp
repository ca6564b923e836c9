// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/diagnosis.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <numeric>
#include <set>

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

/// Standard deviation of chi-squared per sample where only the noise is left.
double noise_of(const Score& score) {
  const int samples = std::accumulate(score.window_count.begin(), score.window_count.end(), 0);
  return std::sqrt(2.0 / samples);
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
  // Force and displacement alone: friction has no balance of its own.
  ASSERT_TRUE(got.location->balances[Balance::force_balance].has_value());
  EXPECT_GT(got.location->balances[Balance::force_balance]->excess, 1.0);
  EXPECT_FALSE(got.location->balances[Balance::friction_law].has_value());
  ASSERT_EQ(got.model.terms.size(), 1U);
  EXPECT_EQ(got.model.terms[0].id, hidden.id);
}

INSTANTIATE_TEST_SUITE_P(Catalogue, OneEffect,
                         ::testing::Values(Concealed{"dry_friction", "friction_force_n", 0.4,
                                                     physics::Relation::friction_law},
                                           Concealed{"cubic_stiffness", "k3_n_m3", 4000.0,
                                                     physics::Relation::force_balance},
                                           Concealed{"quadratic_drag", "drag_n_s2_m2", 1.0,
                                                     physics::Relation::force_balance}),
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
  ASSERT_GE(got.calibrated.size(), 2U);
  EXPECT_EQ(got.calibrated[0].path, "oscillator.stiffness_n_m");
  EXPECT_NEAR(got.calibrated[0].value, 164.0, 0.5);
}

// A recording of 29 s, or what is left of it without 5 s of rows, which may have lasted longer.
Diagnosis diagnosed_without(std::ptrdiff_t rows, std::int64_t pause_ns,
                            const physics::Model& truth) {
  auto recording = record(truth, 29.0);
  auto& frames = recording.frames;
  for (std::size_t i = 2000; i < frames.size(); ++i) frames[i].time_ns += pause_ns;
  frames.erase(frames.begin() + 2000, frames.begin() + 2000 + rows);
  Options options;
  options.threads = 2;
  return diagnose({recording}, driven_mass(), options);
}

void expect_same(const Diagnosis& got, const Diagnosis& whole) {
  EXPECT_EQ(name_of(got.verdict), name_of(whole.verdict)) << report_text(got);
  const Score& score = got.augmented ? *got.augmented : got.baseline;
  EXPECT_NEAR(score.chi2_per_sample, 1.0, 4.0 * noise_of(score));
  ASSERT_EQ(got.calibrated.size(), whole.calibrated.size());
  for (std::size_t i = 0; i < got.calibrated.size(); ++i) {
    const Calibration& each = got.calibrated[i];
    const double sigma = (each.high - each.low) / 3.92;
    EXPECT_NEAR(each.value, whole.calibrated[i].value, 3.0 * sigma) << each.path;
  }
}

TEST(Diagnosis, AGapChangesNoVerdict) {
  constexpr std::int64_t day_ns = 86'400'000'000'000;
  const Diagnosis whole = diagnosed_without(0, 0, driven_mass());
  EXPECT_EQ(name_of(whole.verdict), "consistent");
  expect_same(diagnosed_without(1000, 0, driven_mass()), whole);
  expect_same(diagnosed_without(1000, day_ns, driven_mass()), whole);
}

TEST(Diagnosis, AnEffectIsTheSameBehindAGap) {
  const auto truth = with_term(driven_mass(), "cubic_stiffness", {{"k3_n_m3", {4000.0}}});
  const Diagnosis whole = diagnosed_without(0, 0, truth);
  const Diagnosis got = diagnosed_without(1000, 0, truth);
  expect_same(got, whole);
  ASSERT_EQ(got.findings.size(), 1U) << report_text(got);
  EXPECT_EQ(got.findings[0].effect->card().id, "cubic_stiffness");
  const Estimate& k3 = got.findings[0].parameters.at(0);
  EXPECT_NEAR(k3.value, 4000.0, 0.5 * (k3.high - k3.low));
}

// On a linear spring, with one channel, a constant force and zeros that are off are the same: all
// are named, and none is certain.
TEST(Diagnosis, NamesAConstantForceAndAnOffsetTogether) {
  const Diagnosis got = diagnosed(with_term(driven_mass(), "bias_force", {{"force_n", {0.3}}}));
  EXPECT_EQ(name_of(got.verdict), "missing_physics");
  ASSERT_EQ(got.findings.size(), 1U) << report_text(got);
  std::set<std::string_view> ids = {got.findings[0].effect->card().id};
  for (const Alternative& each : got.findings[0].alternatives) {
    ids.insert(each.candidate.effect->card().id);
  }
  EXPECT_TRUE(ids.contains("bias_force")) << report_text(got);
  EXPECT_TRUE(ids.contains("sensor_offset")) << report_text(got);
  EXPECT_LT(got.findings[0].probability, 0.6);
}

// Beside drag zeros that are off explain a constant force to the noise, at a distance
// from their declared values that no instrument has.
TEST(Diagnosis, NamesWhatAnInstrumentBeyondItsAllowanceStandsFor) {
  auto truth = with_term(driven_mass(), "quadratic_drag", {{"drag_n_s2_m2", {1.0}}});
  truth = with_term(truth, "bias_force", {{"force_n", {0.1}}});
  const Diagnosis got = diagnosed(truth);
  EXPECT_EQ(name_of(got.verdict), "missing_physics") << report_text(got);
  ASSERT_EQ(got.findings.size(), 2U) << report_text(got);
  EXPECT_EQ(got.findings[0].effect->card().id, "quadratic_drag") << report_text(got);
  std::set<std::string_view> second = {got.findings[1].effect->card().id};
  for (const Alternative& each : got.findings[1].alternatives) {
    second.insert(each.candidate.effect->card().id);
  }
  EXPECT_TRUE(second.contains("bias_force")) << report_text(got);
  EXPECT_TRUE(second.contains("sensor_offset")) << report_text(got);
  for (const Calibration& each : got.calibrated) EXPECT_LT(std::abs(each.shift_sigmas), 3.0);
}

// A gain is relative: the fit shifts that of the drive, which is less certain, where the
// displacement's is wrong. Both are tried.
TEST(Diagnosis, TriesAnInstrumentsErrorAtEveryChannel) {
  auto declared = driven_mass();
  declared.sensors[index_of(Channel::displacement)].gain = physics::Parameter{1.0, 0.002};
  declared.sensors[index_of(Channel::drive_force)].gain = physics::Parameter{1.0, 0.005};
  auto truth = with_term(driven_mass(), "quadratic_drag", {{"drag_n_s2_m2", {1.0}}});
  truth.sensors[index_of(Channel::displacement)].gain = physics::Parameter{1.04};
  Options options;
  options.threads = 2;
  const Diagnosis got = diagnose({record(truth, 24.0)}, declared, options);
  std::set<std::string> tried;
  for (const Trial& each : got.trials) {
    if (each.stage == 1) tried.insert(each.id);
  }
  EXPECT_TRUE(tried.contains("gain_error of drive_force")) << report_text(got);
  EXPECT_TRUE(tried.contains("gain_error of displacement")) << report_text(got);
}

class WrongNumber : public ::testing::TestWithParam<double> {};

// By a factor, whether it is declared as exact or with far too small a standard deviation.
TEST_P(WrongNumber, IsNamedWithTheValueThatTheRecordingAsksFor) {
  auto declared = driven_mass();
  declared.oscillator.damping_n_s_m = physics::Parameter{0.5, GetParam()};
  auto truth = declared;
  truth.oscillator.damping_n_s_m = physics::Parameter{1.5};
  Options options;
  options.threads = 2;
  const Diagnosis got = diagnose({record(truth, 24.0)}, declared, options);
  EXPECT_EQ(name_of(got.verdict), "missing_physics") << report_text(got);
  ASSERT_EQ(got.findings.size(), 1U) << report_text(got);
  const Finding& finding = got.findings[0];
  EXPECT_EQ(finding.effect->card().id, "declared_value") << report_text(got);
  EXPECT_EQ(finding.parameter, "oscillator.damping_n_s_m");
  EXPECT_GT(finding.probability, 0.9);
  EXPECT_THAT(
      finding.statement,
      testing::MatchesRegex("damping_n_s_m is 1\\.[45].*, not 0\\.5; with it the model fits."));
  ASSERT_EQ(finding.parameters.size(), 1U);
  EXPECT_EQ(finding.parameters[0].name, "value");
  EXPECT_NEAR(finding.parameters[0].value, 1.5, 0.03);
  EXPECT_LT(finding.parameters[0].low, 1.5);
  EXPECT_GT(finding.parameters[0].high, 1.5);
  EXPECT_LT(got.augmented->chi2_per_sample, 1.2);
  const auto json = report_json(got, {})["findings"][0];
  EXPECT_EQ(json["parameter"], "oscillator.damping_n_s_m");
  EXPECT_EQ(json["relation"], "force_balance");
  EXPECT_TRUE(got.model.terms.empty());
  EXPECT_EQ(got.model.oscillator.damping_n_s_m->value, finding.parameters[0].value);
}

INSTANTIATE_TEST_SUITE_P(Declared, WrongNumber, ::testing::Values(0.0, 0.02), [](const auto& info) {
  return info.param > 0.0 ? "TooCertain" : "Exact";
});

// Noise of another level than declared belongs to the instrument: it is stated, and no physics.
TEST(Diagnosis, StatesNoiseThatIsDeclaredTooSmall) {
  auto truth = driven_mass();
  truth.sensors[index_of(Channel::displacement)].noise_std = 5.0e-5;
  const Diagnosis got = diagnosed(truth);
  EXPECT_EQ(name_of(got.verdict), "consistent") << report_text(got);
  ASSERT_EQ(got.noise_level.size(), 1U);
  EXPECT_EQ(got.noise_level[0].first, Channel::displacement);
  EXPECT_NEAR(got.noise_level[0].second, 2.5, 0.1);
  EXPECT_THAT(report_text(got), testing::HasSubstr("noise of displacement is 2.5"));
  EXPECT_TRUE(report_json(got, {})["noise_level"].contains("displacement"));
  EXPECT_TRUE(diagnosed(driven_mass()).noise_level.empty());
}

// Without the effect its traces count as noise: chi-squared before it is of the noise that is known
// with it.
TEST(Diagnosis, ChiSquaredBeforeAFindingIsOfTheNoiseAfterIt) {
  auto truth = with_term(driven_mass(), "cubic_stiffness", {{"k3_n_m3", {400.0}}});
  truth.sensors[index_of(Channel::displacement)].noise_std = 5.0e-5;
  const Diagnosis got = diagnosed(truth);
  ASSERT_EQ(got.findings.size(), 1U) << report_text(got);
  EXPECT_EQ(got.noise_level.size(), 1U);
  EXPECT_NEAR(got.findings[0].chi2_after, 1.0, 0.2);
  EXPECT_GT(got.findings[0].chi2_before, 100.0);
}

// Three effects at once: each takes little of the misfit that all of them leave.
TEST(Diagnosis, FindsThreeEffectsAtOnce) {
  auto truth = with_term(driven_mass(), "dry_friction", {{"friction_force_n", {0.3}}});
  truth = with_term(truth, "cubic_stiffness", {{"k3_n_m3", {4000.0}}});
  truth = with_term(truth, "quadratic_drag", {{"drag_n_s2_m2", {0.5}}});
  const Diagnosis got = diagnosed(truth);
  EXPECT_EQ(name_of(got.verdict), "missing_physics") << report_text(got);
  std::vector<std::string> ids;
  for (const Finding& finding : got.findings) ids.emplace_back(finding.effect->card().id);
  EXPECT_THAT(ids,
              testing::UnorderedElementsAre("dry_friction", "cubic_stiffness", "quadratic_drag"))
      << report_text(got);
  EXPECT_NEAR(got.augmented->chi2_per_sample, 1.0, 4.0 * noise_of(*got.augmented));
}

// The time of a recording that nothing explains is that of as many searches.
TEST(Diagnosis, SearchesTheCatalogueNoMoreOftenThanAllowed) {
  auto truth = with_term(driven_mass(), "dry_friction", {{"friction_force_n", {0.3}}});
  truth = with_term(truth, "cubic_stiffness", {{"k3_n_m3", {4000.0}}});
  truth = with_term(truth, "quadratic_drag", {{"drag_n_s2_m2", {0.5}}});
  Options options;
  options.threads = 2;
  options.criteria.effort.searches = 1;
  const Diagnosis got = diagnose({record(truth, 24.0)}, driven_mass(), options);
  EXPECT_LE(got.findings.size(), 1U) << report_text(got);
  ASSERT_FALSE(got.trials.empty());
  for (const Trial& trial : got.trials) EXPECT_EQ(trial.stage, 0) << trial.id;
}

// All that dry friction leaves is within what its formula may leave.
TEST(Diagnosis, ClaimsAContradictedNumberBesideAnEffect) {
  auto declared = driven_mass();
  declared.oscillator.damping_n_s_m->sigma = 0.025;
  auto truth = with_term(driven_mass(), "dry_friction", {{"friction_force_n", {1.0}}});
  truth.oscillator.damping_n_s_m->value += 4.0 * 0.025;
  const auto steady = [](double time_s) { return 3.0 * std::sin(4.0 * std::numbers::pi * time_s); };
  Options options;
  options.threads = 2;
  const Diagnosis got = diagnose({record(truth, 24.0, 1, true, steady)}, declared, options);
  std::vector<std::string> names;
  for (const Finding& finding : got.findings) names.push_back(finding.name());
  EXPECT_THAT(names, testing::UnorderedElementsAre("dry_friction",
                                                   "declared_value of oscillator.damping_n_s_m"))
      << report_text(got);
}

// The next run is designed with the uncertainty of all of them, not of the winner alone.
TEST(Diagnosis, EveryOpenHypothesisHasItsPosterior) {
  const auto truth = with_term(driven_mass(), "bias_force", {{"force_n", {0.02}}});
  Options options;
  options.threads = 2;
  options.posterior_axes = 8;
  const Diagnosis got = diagnose({record(truth, 24.0)}, driven_mass(), options);
  EXPECT_GT(got.open_hypotheses.size(), 1U) << report_text(got);
  for (const OpenHypothesis& each : got.open_hypotheses) {
    EXPECT_EQ(each.models.size(), 4U) << each.name << ": stiffness, damping, its own size";
  }
}

// A drawn shape over the velocity takes both at once.
TEST(Diagnosis, NamesTwoEffectsThatOneShapeContains) {
  const auto truth =
      with_term(with_term(driven_mass(), "dry_friction", {{"friction_force_n", {0.1}}}),
                "quadratic_drag", {{"drag_n_s2_m2", {0.02}}});
  const Diagnosis got = diagnosed(truth);
  std::vector<std::string> ids;
  for (const Finding& finding : got.findings) {
    ids.emplace_back(finding.effect->card().id);
    EXPECT_GT(finding.probability, 0.5) << report_text(got);
  }
  EXPECT_THAT(ids, testing::UnorderedElementsAre("dry_friction", "quadratic_drag"))
      << report_text(got);
}

// It takes a sixtieth of what the hysteresis took: more than that formula may leave. A constant
// force of 5 mN would take less, and the limits say so.
TEST(Diagnosis, FindsAWeakEffectBesideAStrongHysteresis) {
  const auto truth = with_term(
      with_term(driven_mass(), "hysteresis", {{"stiffness_n_m", {30.0}}, {"slip_force_n", {0.5}}}),
      "quadratic_drag", {{"drag_n_s2_m2", {0.15}}});
  const Diagnosis got = diagnosed(truth);
  std::vector<std::string> ids;
  for (const Finding& finding : got.findings) {
    ids.emplace_back(finding.effect->card().id);
    EXPECT_EQ(finding.chi2_after, got.findings.back().chi2_after) << "beside the other";
    EXPECT_GT(finding.probability, 0.5) << report_text(got);
  }
  EXPECT_THAT(ids, testing::UnorderedElementsAre("hysteresis", "quadratic_drag"))
      << report_text(got);
  for (const DetectionLimit& each : got.detection.limits) {
    if (each.candidate.name() == "bias_force") {
      EXPECT_GT(each.value, 0.005);
    }
  }
}

// Each of them removes a few hundredths of chi-squared per sample.
void expect_two_weak_effects(const physics::Model& rig) {
  const auto truth = with_term(with_term(rig, "cubic_stiffness", {{"k3_n_m3", {0.5}}}),
                               "quadratic_drag", {{"drag_n_s2_m2", {6.0e-4}}});
  Options options;
  options.threads = 2;
  const Diagnosis got = diagnose({record(truth, 60.0)}, driven_mass(), options);
  EXPECT_LT(got.baseline.chi2_per_sample, 1.2);
  std::vector<std::string> ids;
  for (const Finding& finding : got.findings) ids.emplace_back(finding.effect->card().id);
  EXPECT_THAT(ids, testing::UnorderedElementsAre("cubic_stiffness", "quadratic_drag"))
      << report_text(got);
}

TEST(Diagnosis, FindsTwoWeakEffects) { expect_two_weak_effects(driven_mass()); }

// They show just as well where the noise is less than was declared: chi-squared is below 1 before
// the second one is found.
TEST(Diagnosis, FindsTwoWeakEffectsBelowTheDeclaredNoise) {
  auto rig = driven_mass();
  rig.sensors[index_of(Channel::displacement)].noise_std = 1.85e-5;
  expect_two_weak_effects(rig);
}

// The model that is written states how well every fitted number is known, and explains the same
// recording.
TEST(Diagnosis, WritesThePosterior) {
  const auto truth = with_term(driven_mass(), "cubic_stiffness", {{"k3_n_m3", {4000.0}}});
  const Diagnosis got = diagnosed(truth);
  ASSERT_EQ(got.model.terms.size(), 1U) << report_text(got);
  const physics::Parameter k3 = got.model.terms[0].parameters.at("k3_n_m3");
  EXPECT_GT(k3.sigma, 0.0);
  const Estimate& found = got.findings[0].parameters[0];
  const double of_fit = (found.high - found.low) / 3.92;
  EXPECT_NEAR(k3.sigma, std::hypot(of_fit, found.formula_uncertainty), 0.05 * k3.sigma);
  const physics::Parameter& stiffness = *got.model.oscillator.stiffness_n_m;
  EXPECT_GT(stiffness.sigma, 0.0);
  EXPECT_LT(stiffness.sigma, 0.5) << "declared: 5";
  EXPECT_EQ(got.model.oscillator.mass_kg.sigma, 0.0) << "exact";
  Options options;
  options.threads = 2;
  const Diagnosis again = diagnose({record(truth, 24.0, 2)}, got.model, options);
  EXPECT_EQ(name_of(again.verdict), "consistent") << report_text(again);
}

TEST(Diagnosis, RefusesInvalidCriteria) {
  Options options;
  options.criteria.false_alarm_rate = -1.0;
  EXPECT_THROW(diagnose({record(driven_mass(), 24.0)}, driven_mass(), options),
               std::invalid_argument);
}

/// Of a rig whose friction force of 0.4 N is the finding and is not measured.
void expect_friction(const FrictionPicture& friction) {
  const std::vector<double>& mended = friction.mended.force_n;
  ASSERT_FALSE(mended.empty());
  EXPECT_NEAR(*std::max_element(mended.begin(), mended.end()), 0.4, 0.03);
  for (const double declared : friction.declared.force_n) EXPECT_EQ(declared, 0.0);
  EXPECT_TRUE(friction.recorded.force_n.empty());
  ASSERT_EQ(friction.low_n.size(), mended.size());
  const auto& speed = friction.mended.velocity_m_s;
  const auto fastest =
      static_cast<std::size_t>(std::max_element(speed.begin(), speed.end()) - speed.begin());
  EXPECT_LT(friction.low_n[fastest], mended[fastest]);
  EXPECT_GT(friction.high_n[fastest], mended[fastest]);
  EXPECT_LT(friction.high_n[fastest] - friction.low_n[fastest], 0.1);
}

TEST(Diagnosis, DoesNotDependOnTheNumberOfThreadsAndShowsTheLawOfFriction) {
  const auto truth = with_term(driven_mass(), "dry_friction", {{"friction_force_n", {0.4}}});
  Options options;
  options.threads = 2;
  options.evidence = true;
  const Diagnosis two = diagnose({record(truth, 24.0, 1)}, driven_mass(), options);
  EXPECT_EQ(report_json(diagnosed(truth, 1), {}).dump(), report_json(two, {}).dump());
  ASSERT_TRUE(two.friction);
  expect_friction(*two.friction);
}

}  // namespace
}  // namespace stickslip::diagnosis
