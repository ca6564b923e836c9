// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/grading.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace stickslip::concealment {
namespace {

using Json = nlohmann::ordered_json;
using testing::HasSubstr;

GroundTruth hidden(std::vector<TrueEffect> effects) {
  GroundTruth truth;
  truth.name = "case-001";
  truth.kind = effects.empty() ? "null" : (effects.size() == 1 ? "single" : "pair");
  truth.verdict = effects.empty() ? "consistent" : "missing_physics";
  truth.effects = std::move(effects);
  return truth;
}
TrueEffect cubic() {
  TrueEffect e;
  e.id = "cubic_stiffness";
  e.accept = {"cubic_stiffness"};
  e.relations = {"force_balance"};
  e.parameters["k3_n_m3"] = {1000.0, 0.25, 0.0, true, false};
  return e;
}
TrueEffect delayed_velocity() {
  TrueEffect e;
  e.id = "channel_delay";
  e.accept = {"channel_delay"};
  e.relations = {"sensor"};
  e.channel = Channel::velocity;
  e.parameters["delay_s"] = {0.004, 0.25, 0.0, true, false};
  return e;
}
Json finding(const char* id, const char* relation, const char* name, double value, double half,
             const char* channel = nullptr) {
  Json json;
  json["id"] = id;
  json["relation"] = relation;
  json["channel"] = channel == nullptr ? Json(nullptr) : Json(channel);
  json["parameters"][name] = {{"value", value}, {"ci95", {value - half, value + half}}};
  return json;
}
Json report(const char* verdict, std::vector<Json> findings) {
  Json json;
  json["verdict"] = verdict;
  json["location"] = {{"relation", "force_balance"}, {"when_s", {{0.0, 30.0}}}};
  json["findings"] = findings;
  json["fit"]["heldout"]["baseline"]["chi2_per_sample"] = 9.0;
  json["fit"]["heldout"]["augmented"]["chi2_per_sample"] = 1.02;
  return json;
}

TEST(Grading, CorrectReport) {
  const Grade g =
      grade(hidden({cubic()}),
            report("missing_physics",
                   {finding("cubic_stiffness", "force_balance", "k3_n_m3", 1050.0, 60.0)}));
  EXPECT_TRUE(g.first_right && g.exact && g.relation_right && g.verdict_right);
  EXPECT_EQ(g.parameters, 1);
  EXPECT_EQ(g.within_tolerance, 1);
  EXPECT_EQ(g.within_tenth, 1);
  EXPECT_EQ(g.covered, 1);
  EXPECT_DOUBLE_EQ(*g.chi2_after, 1.02);
}

TEST(Grading, WrongNameFalseAlarmMissAndSurplus) {
  const Json wrong =
      report("missing_physics", {finding("end_stop", "force_balance", "gap_m", 0.01, 0.001)});
  const Grade g = grade(hidden({cubic()}), wrong);
  EXPECT_FALSE(g.first_right || g.exact);
  EXPECT_TRUE(g.relation_right);
  EXPECT_EQ(g.within_tolerance, 0);
  EXPECT_EQ(g.parameters, 1);
  EXPECT_TRUE(grade(hidden({}), wrong).false_alarm);
  EXPECT_TRUE(grade(hidden({}), report("consistent", {})).exact);
  EXPECT_TRUE(grade(hidden({cubic()}), report("consistent", {})).missed);
  const Grade more =
      grade(hidden({cubic()}),
            report("missing_physics",
                   {finding("cubic_stiffness", "force_balance", "k3_n_m3", 1000.0, 60.0),
                    finding("bias_force", "force_balance", "force_n", 0.01, 0.001)}));
  EXPECT_TRUE(more.first_right);
  EXPECT_EQ(more.surplus, 1);
  EXPECT_FALSE(more.exact);
}

TEST(Grading, SensorErrorNeedsItsChannelAndIntervalsMustCoverTheTrueValue) {
  const auto at = [](const char* channel, double half) {
    return report("missing_physics",
                  {finding("channel_delay", "sensor", "delay_s", 0.0045, half, channel)});
  };
  const Grade right = grade(hidden({delayed_velocity()}), at("velocity", 0.001));
  EXPECT_TRUE(right.exact && *right.channel_right);
  EXPECT_EQ(right.covered, 1);
  EXPECT_EQ(grade(hidden({delayed_velocity()}), at("velocity", 0.0001)).covered, 0);
  const Grade elsewhere = grade(hidden({delayed_velocity()}), at("displacement", 0.001));
  EXPECT_FALSE(elsewhere.exact || *elsewhere.channel_right);
  EXPECT_TRUE(elsewhere.first_right);
}

TEST(Grading, PairNeedsBothEffectsAndAnEventItsTime) {
  const auto both = report("missing_physics",
                           {finding("channel_delay", "sensor", "delay_s", 0.004, 1.0, "velocity"),
                            finding("cubic_stiffness", "force_balance", "k3_n_m3", 1000.0, 1.0)});
  EXPECT_TRUE(grade(hidden({cubic(), delayed_velocity()}), both).exact);
  EXPECT_FALSE(
      grade(hidden({cubic(), delayed_velocity()}), report("missing_physics", {both["findings"][1]}))
          .exact);
  TrueEffect event = cubic();
  event.when_s = {{10.0, 20.0}};
  Json timed = report("missing_physics",
                      {finding("cubic_stiffness", "force_balance", "k3_n_m3", 1000.0, 1.0)});
  timed["findings"][0]["when_s"] = {{12.0, 20.0}};
  EXPECT_NEAR(*grade(hidden({event}), timed).overlap, 0.8, 1.0e-12);
}

TEST(Grading, MissingReportIsWrong) {
  const Grade g = grade(hidden({cubic()}), Json(nullptr));
  EXPECT_FALSE(g.exact || g.first_right || g.relation_right);
  EXPECT_TRUE(g.missed);
  EXPECT_EQ(g.parameters, 1);
}

TEST(Summary, HasRatesAndConfusions) {
  Grade good;
  good.kind = "single";
  good.name = "case-001";
  good.hidden = good.named = {"cubic_stiffness"};
  good.first_right = good.exact = good.relation_right = good.verdict_right = true;
  good.verdict = "missing_physics";
  Grade bad = good;
  bad.name = "case-002";
  bad.named = {"end_stop"};
  bad.first_right = bad.exact = false;
  const std::vector<Grade> grades{good, bad};
  const std::string text = summary_text(grades);
  EXPECT_THAT(text, HasSubstr("cubic_stiffness -> end_stop: 1 (case-002)"));
  EXPECT_THAT(text, HasSubstr("1 of 2"));
  EXPECT_EQ(summary_json(grades)["rates"]["single effects named right first"]["hits"], 1);
}

TEST(Grading, TripleCountsTheEffectsThatAreFound) {
  GroundTruth truth = hidden({cubic(), delayed_velocity(), cubic()});
  truth.kind = "triple";
  truth.effects[2].accept = {"bias_force"};
  const Json two = report("missing_physics",
                          {finding("cubic_stiffness", "force_balance", "k3_n_m3", 1000.0, 1.0),
                           finding("channel_delay", "sensor", "delay_s", 0.004, 1.0, "velocity")});
  const std::vector<Grade> grades{grade(truth, two)};
  EXPECT_EQ(grades[0].found, 2);
  EXPECT_FALSE(grades[0].exact);
  const Json rates = summary_json(grades)["rates"];
  EXPECT_EQ(rates["all of three named, nothing more"]["hits"], 0);
  EXPECT_EQ(rates["at least two of three named"]["hits"], 1);
  EXPECT_EQ(rates["unlisted physics called so"]["of"], 0);
  EXPECT_THAT(summary_text(grades), HasSubstr("(three effects)"));
}

TEST(Summary, HasATableByNuisance) {
  GroundTruth null = hidden({});
  null.nuisances = {{"gain", Json::object()}, {"gaps", Json::object()}};
  const Json accusing =
      report("missing_physics", {finding("gain_error", "sensor", "gain", 1.01, 0.1, "velocity")});
  GroundTruth single = hidden({cubic()});
  single.nuisances = {{"gain", Json::object()}};
  const Json right = report("missing_physics",
                            {finding("cubic_stiffness", "force_balance", "k3_n_m3", 1000.0, 1.0)});
  const std::vector<Grade> grades{grade(null, accusing), grade(single, right),
                                  grade(hidden({}), report("consistent", {}))};
  const Json table = summary_json(grades)["by_nuisance"];
  ASSERT_EQ(table.size(), 5U);  // gain, gaps, one alone, several, ideal
  EXPECT_EQ(table[0]["nuisance"], "gain");
  EXPECT_EQ(table[0]["cases"], 2);
  EXPECT_EQ(table[0]["nulls_accused"], 1);
  EXPECT_EQ(table[0]["singles_named_first"], 1);
  EXPECT_EQ(table[1]["singles"], 0);
  EXPECT_EQ(table[4]["nuisance"], "(ideal)");
  EXPECT_EQ(table[4]["nulls_accused"], 0);
  EXPECT_THAT(summary_text(grades), HasSubstr("nulls accused"));
  const std::vector<Grade> ideal{grades[2]};
  EXPECT_TRUE(summary_json(ideal)["by_nuisance"].empty());
}

TEST(Grading, AStudyIsOpenAfterARunThatNamesWronglyOrWithLessThan95Percent) {
  const auto first = [](const char* id, double probability) {
    Json found = finding(id, "force_balance", "k3_n_m3", 1000.0, 60.0);
    found["probability"] = probability;
    return report("missing_physics", {found});
  };
  Json study = {{"runs", 3}, {"rig_time_s", 41.0}, {"used_share", 0.8}};
  for (const auto& [report, is_open] : {std::pair{first("cubic_stiffness", 0.95), false},
                                        {first("cubic_stiffness", 0.94), true},
                                        {first("end_stop", 1.0), true},
                                        {Json(nullptr), true}}) {
    study["first"] = report;
    const StudyGrade g = study_grade(hidden({cubic()}), study);
    EXPECT_EQ(g.open_after_first, is_open) << report.dump();
    EXPECT_EQ(g.runs, 3);
    EXPECT_EQ(g.rig_time_s, 41.0);
  }
}

TEST(Summary, HasATableOfStudies) {
  Grade named;
  named.kind = "single";
  named.first_right = named.exact = true;
  named.study = StudyGrade{2, 30.0, 0.7, true};
  Grade lost = named;
  lost.first_right = lost.exact = false;
  lost.study = StudyGrade{1, 17.0, 0.9, false};
  const std::vector<Grade> grades{named, lost};
  EXPECT_THAT(summary_text(grades), HasSubstr("open after one     1     1/1     1/1"));
  const Json studies = summary_json(grades)["studies"];
  ASSERT_EQ(studies.size(), 2U);
  EXPECT_EQ(studies[0]["named_first"], 1);
  EXPECT_EQ(studies[0]["median_rig_time_s"], 30.0);
  EXPECT_EQ(studies[1]["studies"], 2);
  EXPECT_EQ(studies[1]["largest_share_of_limits"], 0.9);
  EXPECT_TRUE(summary_json(std::vector{Grade{}})["studies"].empty());
}

TEST(Summary, HasADetectionCurve) {
  std::vector<Grade> grades;
  for (const double snr : {0.6, 0.9, 5.0, 100.0}) {
    GroundTruth truth = hidden({cubic()});
    truth.effects[0].snr = snr;
    grades.push_back(grade(
        truth, snr < 0.8 ? report("consistent", {})
                         : report("missing_physics", {finding("cubic_stiffness", "force_balance",
                                                              "k3_n_m3", 1000.0, 1.0)})));
  }
  const Json curve = summary_json(grades)["by_snr"];
  ASSERT_EQ(curve.size(), 3U);
  EXPECT_EQ(curve[0]["snr_to"], 1.0);
  EXPECT_EQ(curve[0]["singles"], 2);
  EXPECT_EQ(curve[0]["singles_named_first"], 1);
  EXPECT_TRUE(curve[2]["snr_to"].is_null());
  EXPECT_THAT(summary_text(grades), HasSubstr("32 or more"));
}

TEST(RateInterval, IsWilsons) {
  // Tabulated for 8 of 10.
  EXPECT_NEAR(rate_interval(8, 10).low, 0.4902, 1.0e-4);
  EXPECT_NEAR(rate_interval(8, 10).high, 0.9433, 1.0e-4);
  EXPECT_EQ(rate_interval(0, 0).high, 1.0);
}

}  // namespace
}  // namespace stickslip::concealment
