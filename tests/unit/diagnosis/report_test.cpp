// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "diagnosis/report/json.h"
#include "diagnosis/report/text.h"
#include "physics/catalogue.h"
#include "physics/declared_value.h"

namespace stickslip::report {

using namespace diagnosis;

namespace {

using ::testing::HasSubstr;

Diagnosis consistent() {
  Diagnosis diagnosis;
  diagnosis.baseline.chi2_per_sample = 1.01;
  diagnosis.baseline.rmse[0] = 2.0e-5;
  diagnosis.baseline.nrmse[0] = 0.004;
  diagnosis.horizon_s = 0.4;
  diagnosis.calibrated = {{"oscillator.mass_kg", 0.0601, 0.4, 0.06, 0.0006, 0.0598, 0.0604}};
  diagnosis.noise_std = {{Channel::displacement, 2.0e-5}};
  diagnosis.noise = {{Channel::displacement, 2.0e-5, 0.01, Noise::Source::estimated}};
  diagnosis.windows = {100, 37, 12};
  diagnosis.trials = {{"stribeck", "stribeck", 0, 3.0, {50.0, 9.0}},
                      {"bias_force", "bias_force", 1, 4.0, {80.0, 9.0}}};
  return diagnosis;
}

Diagnosis ambiguous() {
  Diagnosis diagnosis = consistent();
  diagnosis.verdict = Verdict::missing_physics;
  Location location;
  location.relation = physics::Relation::friction_law;
  location.channel = Channel::friction_force;
  location.when_s = {{1.0, 2.5}};
  location.statement = "Mismatch in the friction law.";
  location.regions = {{.channel = Channel::velocity,
                       .aspect = Aspect::motion,
                       .words = "around reversals",
                       .energy = 9.0,
                       .energy_outside = 1.0,
                       .p_value = 1.0e-6}};
  location.balances.of[index_of(Balance::force_balance)] = BalanceResidual{1.02, 0.4};
  location.balances.of[index_of(Balance::friction_law)] = BalanceResidual{41.2, 1.0e-9};
  diagnosis.location = location;
  Integrity integrity;
  integrity.source = "run.csv";
  integrity.rate_hz = 500.0;
  integrity.duration_s = 30.0;
  integrity.channels = {{.channel = Channel::displacement, .at_high_rail = 12}};
  integrity.remarks = {"3 of 15000 samples are missing"};
  diagnosis.integrity = {integrity};
  Finding finding;
  finding.effect = physics::find_effect("dry_friction");
  finding.statement = "Dry friction of 20 N.";
  finding.parameters = {{"friction_force_n", 20.0, 19.0, 21.0, 0.6, "N"}};
  finding.gain = {812.0, 33.0};
  finding.preferred_over = {{physics::find_effect("stribeck"), {}}};
  finding.probability = 0.6;
  finding.alternatives = {{{physics::find_effect("bias_force"), {}}, 0.4}};
  finding.separating_experiment = "push it both ways";
  diagnosis.findings = {finding};
  diagnosis.augmented = diagnosis.baseline;
  diagnosis.augmented->chi2_per_sample = 1.0;
  diagnosis.noise_estimated = {Channel::displacement};
  return diagnosis;
}

Provenance provenance() {
  return {.command = "stickslip diagnose run.csv --model rig.toml --seed 7",
          .version = "0.2.0",
          .seed = 7,
          .files = {{"run.csv", "ab12"}, {"rig.toml", "cd34"}}};
}

TEST(Report, CommandRepeatsOptionsExactlyWhereTheyAreNotTheDefaults) {
  Provenance out;
  add_horizon(out, std::nullopt);
  add_false_alarm_rate(out, diagnosis::Criteria{}.false_alarm_rate);
  EXPECT_EQ(out.command, "");
  add_horizon(out, 0.45678);
  add_false_alarm_rate(out, 0.0123456);
  EXPECT_EQ(out.command, " --horizon 0.45678 --false-alarm-rate 0.0123456");
}

TEST(ReportJson, ConsistentRecordingHasOnlyTheFit) {
  const auto json = report_json(consistent(), provenance());
  EXPECT_EQ(json["schema"], 1);
  EXPECT_EQ(json["verdict"], "consistent");
  EXPECT_TRUE(json["location"].is_null());
  EXPECT_TRUE(json["findings"].empty());
  // Without findings the augmented model is the declared one.
  EXPECT_EQ(json["fit"]["heldout"]["augmented"], json["fit"]["heldout"]["baseline"]);
  EXPECT_EQ(json["calibrated"]["oscillator.mass_kg"], 0.0601);
  EXPECT_EQ(json["noise_std"]["displacement_m"], 2.0e-5);
}

TEST(ReportJson, HasTheBalancesAndNullForWhatWasNotMeasured) {
  const auto balances = report_json(ambiguous(), provenance())["location"]["balances"];
  EXPECT_EQ(balances.size(), balance_count);
  EXPECT_EQ(balances["force_balance"]["excess"], 1.02);
  EXPECT_EQ(balances["friction_law"]["excess"], 41.2);
  EXPECT_EQ(balances["friction_law"]["p"], 1.0e-9);
  for (const char* absent : {"kinematics", "normal_load", "excitation"}) {
    EXPECT_TRUE(balances[absent].is_null()) << absent;
  }
}

TEST(ReportJson, HasTheFindingWithItsIntervalAndAlternatives) {
  const auto json = report_json(ambiguous(), provenance());
  EXPECT_EQ(json["verdict"], "missing_physics");
  EXPECT_EQ(json["location"]["relation"], "friction_law");
  EXPECT_EQ(json["location"]["channel"], "friction_force");
  const auto& finding = json["findings"][0];
  EXPECT_EQ(finding["id"], "dry_friction");
  EXPECT_EQ(finding["parameters"]["friction_force_n"]["value"], 20.0);
  EXPECT_EQ(finding["parameters"]["friction_force_n"]["ci95"][1], 21.0);
  EXPECT_EQ(finding["alternatives"][0]["id"], "bias_force");
  EXPECT_EQ(finding["separating_experiment"], "push it both ways");
  EXPECT_EQ(json["fit"]["heldout"]["augmented"]["chi2_per_sample"], 1.0);
}

TEST(ReportJson, HasTheRelationThatADeclaredNumberEnters) {
  Diagnosis d = ambiguous();
  Finding& finding = d.findings.front();
  finding.effect = &physics::declared_value();
  finding.parameter = "friction.mu";
  finding.number_enters = physics::Relation::friction_law;
  EXPECT_EQ(report_json(d, provenance())["findings"][0]["relation"], "friction_law");
}

TEST(ReportJson, SeparatesTheFitFromTheFormulaAndTheScoreFromThePreference) {
  const auto json = report_json(ambiguous(), provenance());
  const auto& finding = json["findings"][0];
  EXPECT_EQ(finding["parameters"]["friction_force_n"]["unit"], "N");
  EXPECT_EQ(finding["parameters"]["friction_force_n"]["formula_uncertainty"], 0.6);
  EXPECT_EQ(finding["score_gain"]["value"], 812.0);
  EXPECT_EQ(finding["score_gain"]["se"], 33.0);
  EXPECT_EQ(finding["preferred_over"][0]["id"], "stribeck");
}

TEST(ReportJson, SaysWhatTheNumbersRestOn) {
  const auto json = report_json(consistent(), provenance());
  EXPECT_EQ(json["fit"]["windows"]["fit"], 100);
  EXPECT_EQ(json["fit"]["windows"]["select"], 37);
  EXPECT_EQ(json["fit"]["windows"]["report"], 12);
  const auto& mass = json["calibration"]["oscillator.mass_kg"];
  EXPECT_EQ(mass["declared"], 0.06);
  EXPECT_EQ(mass["declared_sigma"], 0.0006);
  EXPECT_EQ(mass["ci95"][1], 0.0604);
  EXPECT_EQ(mass["unit"], "kg");
  EXPECT_EQ(json["noise"]["displacement"]["source"], "estimated");
  EXPECT_EQ(json["noise"]["displacement"]["correlation_s"], 0.01);
  EXPECT_EQ(json["tried"][0]["ids"][0], "stribeck");
  EXPECT_EQ(json["tried"][0]["score_gain"], 50.0);
  EXPECT_EQ(json["tried"][0]["beside"], 0);
  EXPECT_EQ(json["tried"][1]["beside"], 1);
  EXPECT_EQ(json["provenance"]["seed"], 7);
  EXPECT_EQ(json["provenance"]["sha256"]["run.csv"], "ab12");
}

TEST(ReportJson, HasTheLocationAndTheIntegrityOfTheRecording) {
  const auto json = report_json(ambiguous(), provenance());
  const auto& region = json["location"]["regions"][0];
  EXPECT_EQ(region["channel"], "velocity");
  EXPECT_EQ(region["aspect"], "motion");
  EXPECT_TRUE(region["span"].is_null());
  EXPECT_EQ(region["energy"], 9.0);
  const auto& integrity = json["integrity"][0];
  EXPECT_EQ(integrity["rate_hz"], 500.0);
  EXPECT_EQ(json["integrity"].dump().find("run.csv"), std::string::npos);
  EXPECT_EQ(integrity["channels"]["displacement"]["at_high_rail"], 12);
  EXPECT_EQ(integrity["remarks"][0], "3 of 15000 samples are missing");
}

Diagnosis with_limits() {
  Diagnosis diagnosis = consistent();
  diagnosis.detection.limits = {
      {{physics::find_effect("stribeck"), {}}, 1.0042},
      {{physics::find_effect("cubic_stiffness"), {}}, 310.0},
      {{physics::find_effect("quintic_stiffness"), {}}, 4.0e6},
      {{physics::find_effect("gain_error"), {Channel::velocity, {}}}, 1.02}};
  diagnosis.detection.inseparable = {{1, 2, 0.991}};
  diagnosis.false_alarms = FalseAlarms{20, 1, {0.97, 1.01, 1.04}};
  return diagnosis;
}

TEST(ReportJson, HasTheDetectionLimits) {
  const auto json = report_json(with_limits(), provenance());
  ASSERT_EQ(json["detection"]["limits"].size(), 4U);
  EXPECT_EQ(json["detection"]["limits"][2]["id"], "unlisted");
  EXPECT_EQ(json["detection"]["limits"][2]["name"], "quintic_stiffness");
  EXPECT_EQ(json["detection"]["limits"][3]["name"], "gain_error of velocity");
  EXPECT_EQ(json["detection"]["inseparable"][0]["one"], "cubic_stiffness");
  EXPECT_EQ(json["detection"]["inseparable"][0]["other"], "quintic_stiffness");
  EXPECT_EQ(json["bootstrap"]["recordings"], 20);
  EXPECT_EQ(json["bootstrap"]["alarms"], 1);
  EXPECT_FALSE(report_json(consistent(), provenance()).contains("bootstrap"));
}

// With enough digits to differ from the neutral value, and limited to the listed physics of the
// rig.
TEST(ReportText, ListsTheDetectionLimits) {
  const std::string text = report_text(with_limits());
  EXPECT_THAT(text, HasSubstr("Detection limits (95 %): stribeck (static_ratio = 1.004), "
                              "cubic_stiffness (k3_n_m3 = 310)\n"));
  EXPECT_THAT(text, HasSubstr("Of 20 synthetic recordings"));
  EXPECT_THAT(text, HasSubstr("1 raised a false alarm; noise alone gave a chi-squared of 0.97 to"));
}

TEST(ReportText, SaysWhatAFindingWasPreferredTo) {
  EXPECT_THAT(report_text(ambiguous()),
              HasSubstr("score gain 812 +/- 33 nat, chi-squared per sample"));
  EXPECT_THAT(report_text(ambiguous()),
              HasSubstr("preferred, as the simpler or the listed one, to stribeck, which scores"));
  EXPECT_THAT(report_text(ambiguous()), HasSubstr("21; formula error 0.6, 1 SD)"));
}

TEST(ReportText, SaysWhichParameterTheRecordingDoesNotDetermine) {
  auto diagnosis = ambiguous();
  diagnosis.findings.front().parameters.front().determined = false;
  EXPECT_THAT(report_text(diagnosis), HasSubstr("friction_force_n = 20  (95 %: not determined)\n"));
}

TEST(ReportText, BeginsWithTheVerdict) {
  EXPECT_THAT(report_text(consistent()), ::testing::StartsWith("CONSISTENT"));
  const std::string text = report_text(ambiguous());
  EXPECT_THAT(text, ::testing::StartsWith("MISSING PHYSICS: the model lacks 1 effect."));
  EXPECT_THAT(text, HasSubstr("friction_force_n = 20"));
  EXPECT_THAT(text, HasSubstr("alternative: bias_force (40 %)"));
  EXPECT_THAT(text, HasSubstr("To discriminate: push it both ways"));
  EXPECT_THAT(text, HasSubstr("Noise estimated from the recording, not declared: displacement"));
  EXPECT_THAT(text, HasSubstr("velocity deviates more around reversals (3 times the noise, "
                              "elsewhere 1)"));
  EXPECT_THAT(text, HasSubstr("Recording run.csv: 30 s at 500 Hz\n    3 of 15000 samples"));
  auto unexplained = ambiguous();
  unexplained.verdict = Verdict::unexplained;
  EXPECT_THAT(report_text(unexplained), ::testing::StartsWith("UNEXPLAINED"));
}

}  // namespace
}  // namespace stickslip::report
