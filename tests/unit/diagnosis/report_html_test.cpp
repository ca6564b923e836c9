// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/report/html.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>
#include <vector>

#include "diagnosis/report/formatting.h"
#include "diagnosis/report/headline.h"
#include "diagnosis/report/json.h"
#include "diagnosis/report/plot_svg.h"
#include "diagnosis/report/text.h"
#include "physics/catalogue.h"

namespace stickslip::report {

using namespace diagnosis;

namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

Evidence small_evidence() {
  Evidence evidence;
  evidence.windows = {{.begin_s = 0.0,
                       .end_s = 0.4,
                       .reported = true,
                       .drive_hz = 2.0,
                       .drive_amplitude = 0.004,
                       .before = 9.0,
                       .after = 1.0},
                      {.begin_s = 0.4,
                       .end_s = 0.8,
                       .reported = true,
                       .drive_hz = 2.2,
                       .drive_amplitude = 0.005,
                       .before = 10.0,
                       .after = 1.1}};
  evidence.worst = {.first = 0, .count = 2, .before = 9.5};
  evidence.typical = {.first = 0, .count = 1, .before = 9.0};
  evidence.median = 9.0;
  ChannelEvidence channel;
  channel.sigma = 1.0e-5;
  channel.window_before = {9.0, 10.0};
  channel.window_after = {1.0, 1.1};
  channel.frequency_hz = {0.0, 1.0, 2.0};
  channel.power_before = {5.0, 4.0, 1.0};
  channel.power_after = {1.0, 1.0, 1.0};
  channel.phase_deg = {90.0, 180.0, 270.0};
  channel.phase_before = {3.0, 2.0, 3.0};
  channel.phase_after = {1.0, 1.0, 1.0};
  channel.worst.time_s = {0.0, 0.1, 0.2};
  channel.worst.recorded = channel.worst.before = channel.worst.after = {0.0, 0.001, 0.0};
  channel.typical = channel.worst;
  evidence.channels.push_back(channel);
  evidence.map.displacement_m = 0.01;
  evidence.map.velocity_m_s = 0.1;
  evidence.map.before.assign(PhaseMap::cells * PhaseMap::cells, 3.0);
  evidence.map.after.assign(PhaseMap::cells * PhaseMap::cells, 1.0);
  return evidence;
}

Diagnosis with_a_finding() {
  Diagnosis d;
  d.verdict = Verdict::missing_physics;
  d.location = Location{physics::Relation::force_balance,
                        Channel::displacement,
                        {{0.0, 30.0}},
                        {},
                        std::nullopt,
                        "Mismatch in the force balance of the mass.",
                        {{.channel = Channel::displacement,
                          .aspect = Aspect::displacement,
                          .from = 0.01,
                          .to = 0.02,
                          .words = "at displacements from 0.01 to 0.02 m",
                          .energy = 16.0,
                          .energy_outside = 1.0,
                          .p_value = 1.0e-9}},
                        {}};
  d.location->balances.of[index_of(Balance::force_balance)] = BalanceResidual{41.2, 1.0e-9};
  Finding finding;
  finding.effect = physics::find_effect("cubic_stiffness");
  finding.statement = "The spring hardens.";
  finding.parameters = {{"k3_n_m3", 700.0, 680.0, 720.0, 21.0, "N/m3"}};
  finding.probability = 0.9;
  finding.alternatives = {{CandidateEffect{physics::find_effect("end_stop"), {}}, 0.1}};
  finding.separating_experiment = "stepped amplitudes";
  finding.portrait = {{"displacement",
                       "m",
                       "force against +x",
                       "N",
                       {-0.01, 0.0, 0.01},
                       {-0.007, 0.0, 0.007},
                       {-0.008, 0.0, 0.006},
                       {-0.006, 0.0, 0.008}}};
  d.findings.push_back(finding);
  d.baseline.chi2_per_sample = 9.5;
  d.augmented = d.baseline;
  d.augmented->chi2_per_sample = 1.02;
  d.baseline.rmse[0] = 1.234e-4;
  d.augmented->rmse[0] = 2.19e-5;
  d.horizon_s = 0.4;
  d.windows.report = 28;
  d.windows.select = 9;
  d.windows.fit = 64;
  d.calibrated = {{.path = "oscillator.mass_kg",
                   .value = 0.0612,
                   .shift_sigmas = 1.5,
                   .declared = 0.06,
                   .sigma = 0.0008,
                   .low = 0.0606,
                   .high = 0.0618}};
  d.noise_std = {{Channel::displacement, 1.0e-5}};
  d.trials = {{"cubic_stiffness", "cubic_stiffness", 0, 7.5, {}},
              {"end_stop", "end_stop", 0, 5.0, {}}};
  Integrity integrity;
  integrity.source = "run.csv";
  integrity.channels = {{.channel = Channel::displacement}};
  integrity.remarks = {"a clipped channel"};
  d.integrity = {integrity};
  d.evidence = small_evidence();
  return d;
}

Provenance provenance() {
  return {"stickslip diagnose <odd> & name.csv --model m.toml",
          "1.2.3",
          42,
          {{"<odd> & name.csv", "abc123"}}};
}

// The first violation of XML: a tag that is not closed in order, an unquoted attribute, an
// unescaped ampersand. Empty for well-formed markup.
std::string markup_error(const std::string& page) {
  std::vector<std::string> open;
  for (std::size_t at = page.find('<'); at != std::string::npos; at = page.find('<', at)) {
    const std::size_t end = page.find('>', at);
    if (end == std::string::npos) return "a tag is never closed";
    std::string tag = page.substr(at + 1, end - at - 1);
    at = end;
    if (tag.starts_with("!DOCTYPE")) continue;
    if (tag.find('<') != std::string::npos) return "a tag within " + tag;
    if (std::count(tag.begin(), tag.end(), '"') % 2 != 0) return "an odd quote in " + tag;
    if (tag.ends_with("/")) continue;
    if (tag.starts_with("/")) {
      if (open.empty() || open.back() != tag.substr(1)) return "unexpected " + tag;
      open.pop_back();
      continue;
    }
    open.push_back(tag.substr(0, tag.find_first_of(" \n")));
  }
  for (std::size_t at = page.find('&'); at != std::string::npos; at = page.find('&', at + 1)) {
    bool known = false;
    for (const char* entity : {"&lt;", "&gt;", "&amp;", "&quot;", "&#39;"}) {
      known = known || page.compare(at, std::strlen(entity), entity) == 0;
    }
    if (!known) return "an ampersand before " + page.substr(at, 12);
  }
  return open.empty() ? "" : open.back() + " is never closed";
}

std::string first_screen_of(const std::string& page) {
  return page.substr(page.find("<header"), page.find("</header>") - page.find("<header"));
}

// One diagnosis per kind of answer.
Diagnosis consistent() {
  Diagnosis d;
  d.baseline.chi2_per_sample = 1.004;
  d.windows.report = 28;
  d.windows.select = 9;
  d.horizon_s = 0.4;
  d.baseline.rmse[0] = 1.2e-5;
  d.noise_std = {{Channel::displacement, 1.0e-5}};
  d.detection.limits = {
      {CandidateEffect{physics::find_effect("cubic_stiffness"), {}}, 6540.0, 0.0},
      {CandidateEffect{physics::find_effect("gain_error"), {Channel::velocity, {}}}, 1.1, 0.0}};
  d.evidence = small_evidence();
  return d;
}
Diagnosis ambiguous() {
  Diagnosis d = with_a_finding();
  d.findings.front().probability = 0.7;
  d.findings.front().alternatives.front().probability = 0.3;
  return d;
}
Diagnosis confident() {
  Diagnosis d = with_a_finding();
  d.findings.front().probability = 0.9996;
  d.findings.front().alternatives.clear();
  d.findings.front().separating_experiment.reset();
  return d;
}
Diagnosis unexplained() {
  Diagnosis d = with_a_finding();
  d.verdict = Verdict::unexplained;
  d.findings.clear();
  d.augmented.reset();
  return d;
}

TEST(ReportHtml, HasFindingsConfidenceAndReproduction) {
  const std::string page = report_html(with_a_finding(), provenance());
  for (const char* part :
       {"hardening or softening spring", "Mismatch in the force balance", "k3_n_m3", "end stop",
        "stepped amplitudes", "force against +x over displacement", "Phase space", "seed 42",
        "1.2.3", "abc123", "at displacements from 0.01 to 0.02 m", "a clipped channel",
        "oscillator.mass_kg", "0.06060 to 0.06180", "95 % interval", "Operating condition",
        "By phase of the excitation", "Channel by time",
        "in which the declared model fits worst"}) {
    EXPECT_THAT(page, HasSubstr(part));
  }
}

TEST(ReportHtml, FirstScreenHasTheNumbersOfTheDiagnosis) {
  const std::string top = first_screen_of(report_html(with_a_finding(), provenance()));
  for (const char* part :
       {"9.50 \u2192 1.02", "123\u00a0\u00b5m \u2192 21.9\u00a0\u00b5m", "up to 0.4\u00a0s ahead",
        "<b>90\u00a0%</b>", "end stop (10\u00a0%)", "700</span>", "680 to 720",
        "700</span>\u00a0N/m\u00b3", "7.5 standard errors over the 9 selection windows",
        "4.00 times the noise", "elsewhere 1.00"}) {
    EXPECT_THAT(top, HasSubstr(part));
  }
}

// Those of the augmented model, not those of the declared model calibrated without the finding.
TEST(ReportHtml, DescribesTheRigWithTheFittedParameters) {
  Diagnosis d = with_a_finding();
  d.model.oscillator.mass_kg.value = 0.0612;
  d.baseline_model.oscillator.mass_kg.value = 0.0521;
  const std::string page = report_html(d, provenance());
  EXPECT_THAT(page, HasSubstr("A mass of 0.0612"));
  EXPECT_THAT(page, Not(HasSubstr("0.0521")));
}

std::string without_tags(const std::string& page) {
  std::string text;
  bool in_tag = false;
  for (const char c : page) {
    if (c == '<') text += ' ';
    in_tag = c == '<' || (in_tag && c != '>');
    if (!in_tag && c != '>') text += c;
  }
  return text;
}

TEST(ReportHtml, ADimensionlessModelHasNoUnits) {
  const std::regex unit(
      "[0-9](\\s|\u00a0)(mm|\u00b5m|nm|m|m/s|mm/s|N|mN|N/m|s|ms|Hz|kg|1/s)[^a-z0-9]|"
      "\\[(mm?|s|ms|Hz|m?N|m?m/s)\\]|N/m|unit of|suffix of a name");
  Diagnosis d = with_a_finding();
  d.findings.front().statement = "It hits a stop after 2 mm.";
  d.findings.front().when_s = {1.0, 2.0};
  d.integrity.front().channels.front().mains =
      physics::Line{.frequency_hz = 50.0, .amplitude = 0.001};
  d.model.normal_load = physics::NormalLoad{};
  d.model.normal_load->load_n.value = 0.15;
  d.model.friction.law = physics::FrictionLaw::state_variable;
  d.model.friction.rate_per_s.value = 150.0;
  d.model.oscillator.stiffness_n_m = physics::Parameter{13.6};
  EXPECT_TRUE(std::regex_search(without_tags(report_html(d, provenance())), unit));
  EXPECT_TRUE(std::regex_search(report_text(d), unit));
  d.model.dimensionless = true;
  use_units_of_model(d);
  for (const std::string& text : {without_tags(report_html(d, provenance())), report_text(d)}) {
    std::smatch found;
    const bool has_unit = std::regex_search(text, found, unit);
    EXPECT_FALSE(has_unit) << found.prefix().str().substr(
                                  found.prefix().length() > 200 ? found.prefix().length() - 200 : 0)
                           << found.str();
    EXPECT_THAT(text, HasSubstr("It hits a stop after 0.002."));
  }
  EXPECT_TRUE(
      nlohmann::json::parse(report_json(d, provenance()).dump()).at("dimensionless").get<bool>());
}

TEST(ReportHtml, EveryKindOfAnswerHasItsFirstScreen) {
  EXPECT_THAT(first_screen_of(report_html(consistent(), provenance())),
              AllOf(HasSubstr("No missing physics"), HasSubstr("class=\"consistent\""),
                    HasSubstr("1.00</b>"), HasSubstr("28 held-out windows"),
                    HasSubstr("noise 10.0\u00a0\u00b5m"),
                    HasSubstr("hardening or softening spring (<code>k3_n_m3</code> = "
                              "6540\u00a0N/m\u00b3)"),
                    Not(HasSubstr("wrong gain")), Not(HasSubstr("\u2192"))));
  EXPECT_THAT(first_screen_of(report_html(confident(), provenance())),
              AllOf(HasSubstr("The model lacks one physical effect: hardening"),
                    HasSubstr("&gt;\u00a099.9\u00a0%"), HasSubstr("on another recording")));
  EXPECT_THAT(
      first_screen_of(report_html(ambiguous(), provenance())),
      AllOf(HasSubstr("most likely hardening"), HasSubstr("does not rule out end stop"),
            HasSubstr("To discriminate: stepped amplitudes"), HasSubstr("class=\"ambiguous\"")));
  EXPECT_THAT(first_screen_of(report_html(unexplained(), provenance())),
              AllOf(HasSubstr("none of the candidate effects explains why"), HasSubstr("Next step"),
                    HasSubstr("class=\"unexplained\"")));
}

TEST(ReportHtml, IsWellFormedForEveryAnswer) {
  for (const Diagnosis& d : {consistent(), confident(), ambiguous(), unexplained(), Diagnosis()}) {
    EXPECT_EQ(markup_error(report_html(d, provenance())), "");
  }
}

TEST(ReportHtml, TheHeadlineFollowsChiSquared) {
  Diagnosis d = confident();
  EXPECT_EQ(answer_of(d), Answer::named);
  d.baseline.chi2_per_sample = 9940.0;
  d.augmented->chi2_per_sample = 495.0;
  EXPECT_EQ(answer_of(d), Answer::partial);
  const std::string first = first_screen_of(report_html(d, provenance()));
  EXPECT_THAT(first, HasSubstr("not all of it identified"));
  EXPECT_THAT(first, HasSubstr("Most of the mismatch is explained, not all"));
  EXPECT_THAT(headline_of(d), HasSubstr("9940"));
  EXPECT_THAT(headline_of(d), HasSubstr("495"));
  EXPECT_THAT(report_text(d), HasSubstr("Most of the mismatch is explained, not all."));
}

TEST(ReportHtml, TwoExplanationsAreOneSentenceWithOr) {
  Diagnosis d = ambiguous();
  EXPECT_THAT(headline_of(d), HasSubstr("most likely")) << "70 % and 30 %";
  d.findings.front().probability = 0.5;
  d.findings.front().alternatives.front().probability = 0.5;
  EXPECT_THAT(headline_of(d), HasSubstr("(50\u00a0%) or "));
  EXPECT_THAT(headline_of(d), Not(HasSubstr("most likely")));
  EXPECT_THAT(first_screen_of(report_html(d, provenance())), Not(HasSubstr("Also possible")));
  d.findings.push_back(d.findings.front());
  EXPECT_THAT(headline_of(d), HasSubstr("; ")) << "an \"and\" beside the \"or\" is ambiguous";
}

TEST(ReportHtml, TheNoiseIsThatWhichResidualsAreJudgedBy) {
  Diagnosis d = ambiguous();
  d.noise_std = {{Channel::displacement, 1.0e-6}, {Channel::drive_force, 1.0e-15}};
  d.noise = {{Channel::displacement, 6.0e-6, 0.1}};
  const std::string page = report_html(d, provenance());
  EXPECT_THAT(page, HasSubstr("6.00\u00a0\u00b5m"));
  EXPECT_THAT(page, HasSubstr("a slow part is correlated over 0.1\u00a0s"));
  EXPECT_THAT(page, HasSubstr("none visible"));
}

TEST(ReportHtml, AGainWithinItsStandardErrorIsNotSignificant) {
  Diagnosis d = confident();
  EXPECT_THAT(report_html(d, provenance()), Not(HasSubstr("not significant")));
  d.trials.front().gain_z = 0.35;
  const std::string page = report_html(d, provenance());
  EXPECT_THAT(first_screen_of(page),
              HasSubstr("0.35 standard errors over the 9 selection windows"));
  EXPECT_THAT(first_screen_of(page), HasSubstr("is not significant"));
  EXPECT_THAT(first_screen_of(page), Not(HasSubstr("improves the prediction")));
  EXPECT_THAT(page, HasSubstr("0.35, not significant"));
}

TEST(ReportHtml, AChiSquaredFarBelow1SaysThatTheNoiseWasTooLarge) {
  Diagnosis d = consistent();
  EXPECT_THAT(report_html(d, provenance()), Not(HasSubstr("far below 1")));
  d.baseline.chi2_per_sample = 0.31;
  EXPECT_THAT(first_screen_of(report_html(d, provenance())), HasSubstr("was declared too large"));
  d.noise_estimated = {Channel::displacement};
  EXPECT_THAT(first_screen_of(report_html(d, provenance())), HasSubstr("was estimated too large"));
  EXPECT_THAT(report_text(d), HasSubstr("was estimated too large"));
}

TEST(ReportHtml, NumbersOfSentencesStandInTables) {
  Diagnosis d = confident();
  d.findings.front().gain = {812.0, 33.0};
  d.findings.front().chi2_before = 8.75;
  d.false_alarms = FalseAlarms{40, 3, {0.91, 1.13}};
  d.noise_level = {{Channel::displacement, 1.37}};
  const std::string page = report_html(d, provenance());
  for (const char* cells : {"<th scope=\"row\">gain [nat]</th><td></td><td>812 \u00b1 33.0</td>",
                            "<th scope=\"row\">chi-squared per sample</th><td>8.75</td>",
                            "<th scope=\"row\">synthetic recordings</th><td>40</td>",
                            "<th scope=\"row\">false alarms</th><td>3</td>", "<td>1.37</td>",
                            "<th scope=\"row\">worst, shown</th><td>9.50</td>",
                            "<th scope=\"row\">typical, shown</th><td>9.00</td>"}) {
    EXPECT_THAT(page, HasSubstr(cells));
  }
}

TEST(ReportHtml, PicturesOfAPeriodicDriveNeedOne) {
  Diagnosis d = confident();
  EXPECT_THAT(report_html(d, provenance()),
              AllOf(HasSubstr("By phase of the excitation"), HasSubstr("By operating condition")));
  d.evidence->drive_is_periodic = false;  // a move from point to point
  const std::string page = report_html(d, provenance());
  EXPECT_THAT(page, AllOf(Not(HasSubstr("phase of the excitation")),
                          Not(HasSubstr("perating condition")), HasSubstr("By frequency")));
  EXPECT_EQ(markup_error(page), "");
  d.evidence->map.velocity_m_s = 1.0e-12;
  EXPECT_THAT(report_html(d, provenance()), Not(HasSubstr("phase space, declared")));
}

TEST(ReportHtml, TheNoiseBandIsSeenBesideALargeResidual) {
  Diagnosis d = confident();
  for (double& each : d.evidence->channels.front().worst.before) each += 0.5;  // 50000 noises
  const std::string page = report_html(d, provenance());
  const std::regex area(
      "<path class=\"area s0\" d=\"M[0-9.]+ ([0-9.]+)L[0-9.]+ ([0-9.]+)"
      "L[0-9.]+ ([0-9.]+)");
  std::smatch found;
  ASSERT_TRUE(std::regex_search(page, found, area));
  EXPECT_GT(std::abs(std::stod(found[1]) - std::stod(found[3])), 20.0) << "pixels";
  EXPECT_THAT(page, HasSubstr("logarithmic beyond the band"));
}

TEST(ReportHtml, AFrictionFindingShowsTheLawOverVelocityAndDisplacementWithTheData) {
  Diagnosis d = confident();
  EXPECT_THAT(report_html(d, provenance()), Not(HasSubstr("Friction over")));
  FrictionPicture friction;
  friction.recorded = {{-0.01, 0.0, 0.01}, {0.1, 0.0, -0.1}, {1.0, 0.2, -1.0}};
  friction.declared = {{-0.01, 0.0, 0.01}, {-0.1, 0.0, 0.1}, {-0.9, 0.0, 0.9}};
  friction.mended = {{-0.01, 0.0, 0.01}, {-0.1, 0.0, 0.1}, {-1.0, 0.0, 1.0}};
  friction.low_n = {-1.1, -0.1, 0.9};
  friction.high_n = {-0.9, 0.1, 1.1};
  d.friction = friction;
  const std::string page = report_html(d, provenance());
  EXPECT_EQ(markup_error(page), "");
  for (const char* words :
       {"Friction over velocity", "Friction over displacement", "class=\"points s0\"",
        "class=\"area s2\"", ">declared<", ">augmented<"}) {
    EXPECT_THAT(page, HasSubstr(words));
  }
}

TEST(Stretches, TheWorstHasTheWorstWindowAndTheTypicalAMedianOne) {
  Evidence evidence;
  const auto add = [&](double begin_s, double before, bool reported = true) {
    evidence.windows.push_back(
        {.begin_s = begin_s, .end_s = begin_s + 1.0, .reported = reported, .before = before});
  };
  for (const double each : {4.0, 5.0, 4.0}) add(static_cast<double>(evidence.windows.size()), each);
  add(3.0, 100.0, false);
  add(4.0, 60.0);  // alone
  add(5.0, 2.0, false);
  add(6.0, 3.0);
  choose_stretches(evidence);
  EXPECT_EQ(evidence.worst.first, 4U);
  EXPECT_EQ(evidence.worst.count, 1U);
  EXPECT_EQ(evidence.worst.before, 60.0);
  EXPECT_EQ(evidence.median, 4.0);
  EXPECT_EQ(evidence.typical.first, 0U);
  EXPECT_EQ(evidence.typical.count, 3U);
  // Neighbours in both would be shown twice.
  evidence.windows.resize(3);
  choose_stretches(evidence);
  EXPECT_EQ(evidence.worst.first, 1U);
  EXPECT_EQ(evidence.worst.count, 1U);
  EXPECT_EQ(evidence.typical.count, 1U);
  EXPECT_NE(evidence.typical.first, 1U);
  evidence.windows.resize(1);
  choose_stretches(evidence);
  EXPECT_EQ(evidence.worst.count, 1U);
  EXPECT_EQ(evidence.typical.count, 0U);
}

TEST(ReportHtml, SeparatesTheFormulaFromTheFitAndSaysWhatScoresBetter) {
  Diagnosis d = with_a_finding();
  d.findings.front().preferred_over = {{physics::find_effect("end_stop"), {}}};
  const std::string page = without_tags(report_html(d, provenance()));
  EXPECT_THAT(page, HasSubstr("\u00b1 21"));
  EXPECT_THAT(page, HasSubstr("It is the simpler or the listed one: end stop scores better."));
}

TEST(ReportHtml, ListsTheBalancesMeasuredOrNot) {
  const std::string page = report_html(with_a_finding(), provenance());
  EXPECT_THAT(page, HasSubstr("force balance"));
  EXPECT_THAT(page, HasSubstr("41.2"));
  EXPECT_THAT(page, HasSubstr("not measured"));
}

TEST(ReportHtml, HeadingLevelsAreNotSkipped) {
  const std::string page = report_html(with_a_finding(), provenance());
  int before = 0;
  int ones = 0;
  for (std::size_t at = page.find("<h"); at != std::string::npos; at = page.find("<h", at + 1)) {
    const int level = page[at + 2] - '0';
    if (level < 1 || level > 6) continue;
    EXPECT_LE(level, before + 1);
    ones += level == 1 ? 1 : 0;
    before = level;
  }
  EXPECT_EQ(ones, 1);
}

TEST(ReportHtml, LoadsNoResourcesAndRunsNoScript) {
  const std::string page = report_html(with_a_finding(), provenance());
  for (const char* part : {"http:", "https:", "src=", "@import", "url(", "<script", "<link",
                           "<iframe", "javascript:"}) {
    EXPECT_THAT(page, Not(HasSubstr(part)));
  }
  for (const char* handler : {" onload=", " onclick=", " onerror=", " onmouseover="}) {
    EXPECT_THAT(page, Not(HasSubstr(handler)));
  }
  for (std::size_t at = page.find("href="); at != std::string::npos;
       at = page.find("href=", at + 1)) {
    EXPECT_EQ(page.substr(at, 7), "href=\"#");
  }
}

TEST(ReportHtml, EscapesNames) {
  const std::string hostile = "</code><script>alert(\"1\")</script>&'<img src=x onerror=y>\x01";
  Diagnosis d = with_a_finding();
  d.integrity.front().source = hostile;
  d.integrity.front().remarks = {hostile};
  d.findings.front().statement = hostile;
  d.findings.front().separating_experiment = hostile;
  d.findings.front().parameters.front().name = hostile;
  d.location->statement = hostile;
  d.location->regions.front().words = hostile;
  d.calibrated.front().path = hostile;
  d.trials.front().id = hostile;
  const std::string page = report_html(
      d, {hostile, hostile, 1, {{hostile, hostile}}, {{hostile, hostile}}, hostile, hostile});
  EXPECT_EQ(markup_error(page), "");
  for (const char* part : {"<script", "<img", "\x01"}) EXPECT_THAT(page, Not(HasSubstr(part)));
  EXPECT_THAT(page, HasSubstr("&lt;script&gt;alert(&quot;1&quot;)&lt;/script&gt;&amp;&#39;"));
}

TEST(ReportHtml, IsDeterministic) {
  EXPECT_EQ(report_html(with_a_finding(), provenance()),
            report_html(with_a_finding(), provenance()));
}

TEST(ReportHtml, EveryFigureHasADescriptionAndACaption) {
  const std::string page = report_html(with_a_finding(), provenance());
  const auto count = [&page](const std::string& part) {
    std::size_t times = 0;
    for (std::size_t at = page.find(part); at != std::string::npos; at = page.find(part, at + 1)) {
      ++times;
    }
    return times;
  };
  EXPECT_GE(count("<svg"), 12U);
  EXPECT_EQ(count("<desc>"), count("<svg"));
  EXPECT_EQ(count("<figcaption>"), count("<svg"));
  EXPECT_EQ(count("<caption>"), count("<table>"));
}

TEST(Formatting, NumbersAndUnits) {
  EXPECT_EQ(format_number(7310.4), "7310");
  EXPECT_EQ(format_number(73104.0), "73100");
  EXPECT_EQ(format_number(-0.01254), "\u22120.0125");
  EXPECT_EQ(format_number(0.9996), "1.00");
  EXPECT_EQ(format_number(1.2e-6), "1.20 \u00d7 10\u207b\u2076");
  EXPECT_EQ(format_number(0.0), "0");
  EXPECT_EQ(format_number(std::numeric_limits<double>::quiet_NaN()), "not known");
  EXPECT_EQ(format_quantity(2.19e-5, "m"), "21.9\u00a0\u00b5m");
  EXPECT_EQ(format_quantity(0.13, "N"), "130\u00a0mN");
  EXPECT_EQ(format_quantity(1.5, "1"), "1.50");
  EXPECT_EQ(format_quantity(1.07e-4, "m", 2.52e-4), "0.107\u00a0mm");
  EXPECT_EQ(plain_text("k3_n_m3 is 7000, +5 - 3.5e, 1e999 and -"),
            "k3_n_m3 is 7000, +5 - 3.5e, 1e999 and -");
  EXPECT_EQ(plain_text("+2.5e+01"), plain_text("2.5e+01"));
  EXPECT_EQ(plain_text("friction_force wanders by -1.25e-05 N in 4.38e+03 s"),
            "friction force wanders by \u22121.25 \u00d7 10\u207b\u2075 N in 4380 s");
  EXPECT_EQ(unit_text("unit of the channel per second", {Channel::velocity, {}},
                      physics::ResultUnits({})),
            "m/s per second");
  EXPECT_EQ(plain_text("friction_force_n from -0.08 to 0.9 m/s (-3)"),
            "friction_force_n from \u22120.08 to 0.9 m/s (\u22123)");
  EXPECT_EQ(unit_text("1/unit of the channel", {Channel::velocity, {}}, physics::ResultUnits({})),
            "1/(m/s)");
  EXPECT_EQ(unit_text("1", {}, physics::ResultUnits({})), "");
  EXPECT_EQ(unit_text("N s^2/m2", {}, physics::ResultUnits({})), "N s\u00b2/m\u00b2");
  EXPECT_EQ(format_percent(0.99999), ">\u00a099.9\u00a0%");
  EXPECT_EQ(with_probability("end stop", "30 %"), "end stop (30 %)");
  EXPECT_EQ(with_probability("wrong gain (velocity)", "30 %"), "wrong gain (velocity, 30 %)");
}

TEST(Formatting, IntervalSetsTheNumberOfDigits) {
  const EstimateText close = format_estimate(1.15, 1.141, 1.159);
  EXPECT_EQ(close.value, "1.1500");
  EXPECT_EQ(close.low, "1.1410");
  const EstimateText wide = format_estimate(-7300.0, -7750.0, -6840.0);
  EXPECT_EQ(wide.value, "\u22127300");
  EXPECT_EQ(wide.high, "\u22126840");
  EXPECT_EQ(format_estimate(9.9, 9.5, 10.3).high, "10.30");
  EXPECT_EQ(format_estimate(4.3e-6, -8.4826e-4, 8.5704e-4).low, "\u22120.00085")
      << "a value far below the width";
}

TEST(Formatting, AnIntervalOverDecadesSaysThatTheValueIsNotDetermined) {
  EXPECT_EQ(interval_text(0.514, 0.00106, 248.0), "not determined");
  EXPECT_EQ(interval_text(20.4, 20.1, 20.7), "20.10 to 20.70");
  EXPECT_EQ(interval_text(0.0, -1.0, 2.0e4), "\u22121 to 20000") << "zero lies within";
}

TEST(Formatting, AShiftOfNothingHasNoSign) {
  EXPECT_EQ(shift_text(0.01), "0.0");
  EXPECT_EQ(shift_text(-0.01), "0.0");
  EXPECT_EQ(shift_text(0.6), "+0.6");
}

Diagnosis of_a_campaign() {
  Diagnosis d = ambiguous();
  d.integrity.resize(3, d.integrity.front());
  Finding& finding = d.findings.front();
  finding.shared = {"physics.cubic_stiffness.k3_n_m3", physics::Sharing::proportional, "load_n"};
  Alternative& other = finding.alternatives.front();
  other.candidate = finding;
  other.candidate.shared.sharing = physics::Sharing::power;
  d.campaign.emplace();
  d.campaign->campaign.runs = {{"light", {}, {}, {}}, {"heavy", {}, {}, {}}, {"other", {}, {}, {}}};
  Comparison shared;
  shared.number = finding.shared;
  shared.value = 0.43285;
  shared.low = 0.43257;
  shared.high = 0.43312;
  shared.trend = Trend{0.30012, 0.29993, 0.30031, false};
  shared.freedom = 1;
  d.campaign->comparisons = {shared};
  HeldOutRecording held_out;
  held_out.recording = 2;
  held_out.baseline.rmse[0] = 3.52e-3;
  held_out.augmented = held_out.baseline;
  held_out.augmented->rmse[0] = 2.16e-5;
  d.campaign->held_out = {held_out};
  return d;
}

TEST(ReportHtml, OfACampaignNamesTheConditionThatACandidateFollows) {
  const Diagnosis d = of_a_campaign();
  const std::string page = report_html(
      d, {"stickslip diagnose --campaign c.toml",
          "1.2.3",
          42,
          {{"a.csv", ""}, {"b.csv", ""}, {"c.csv", ""}, {"m.toml", ""}, {"c.toml", ""}}});
  EXPECT_EQ(markup_error(page), "");
  for (const char* part :
       {"(proportional to load_n); these recordings alone do not rule out hardening or softening "
        "spring (depending on load_n).",
        "<code>c.csv</code>, model <code>m.toml</code>, campaign <code>c.toml</code>",
        "cubic_stiffness with load_n, proportional", "only the first is drawn, run.csv",
        "0.43285 (95 %: 0.43257 to 0.43312); coefficient 0.30012 (95 %: 0.29993 to 0.30031)",
        "<td>3.52\u00a0mm</td><td>0.0216\u00a0mm</td>"}) {
    EXPECT_THAT(page, HasSubstr(part));
  }
  EXPECT_THAT(report_text(d), AllOf(HasSubstr("1. cubic_stiffness with load_n, proportional:"),
                                    HasSubstr("alternative: cubic_stiffness with load_n (")));
}

TEST(Formatting, TrialsAreNamedAfterTheirEffects) {
  EXPECT_EQ(trial_name("gain_error of friction_force + cubic_stiffness"),
            "wrong gain (friction force) and hardening or softening spring");
  EXPECT_EQ(trial_name("crosstalk of velocity from displacement"),
            "crosstalk (velocity from displacement)");
  EXPECT_EQ(trial_name("dry_friction with load_n"), "dry friction (depending on load_n)");
  EXPECT_EQ(trial_name("gain_error of velocity in each recording"),
            "wrong gain (velocity, different in each recording)");
  EXPECT_EQ(trial_name("not in the catalogue"), "not in the catalogue");
}

TEST(LinePlot, ACycleThatReturnsOnItsOwnWayIsDrawnOnce) {
  const Series curve =
      without_way_back({"", {1.0, 0.0, -1.0, 0.0, 1.0}, {2.0, 0.0, -2.0, 0.0, 2.0}, 1});
  EXPECT_THAT(curve.x, testing::ElementsAre(-1.0, 0.0, 0.0, 1.0, 1.0));
  EXPECT_THAT(curve.y, testing::ElementsAre(-2.0, 0.0, 0.0, 2.0, 2.0));
  const Series loop{"", {1.0, 0.0, -1.0, 0.0, 1.0}, {2.0, 2.0, -2.0, -2.0, 2.0}, 1};
  EXPECT_EQ(without_way_back(loop).x, loop.x);
  EXPECT_EQ(without_way_back(loop).y, loop.y);
}

TEST(LinePlot, OmitsNonFiniteValuesAndKeepsEverySpike) {
  LinePlot plot;
  Series series;
  for (int i = 0; i < 20000; ++i) {
    series.x.push_back(i);
    series.y.push_back(i == 12345 ? 1000.0 : std::sin(i * 0.01));
  }
  series.y[10] = std::numeric_limits<double>::quiet_NaN();
  plot.series.push_back(series);
  const std::string svg = line_plot_svg(plot);
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  // At most two of the 20000 points per pixel column.
  EXPECT_LT(svg.size(), 60000U);
  plot.series[0].y[12345] = 0.0;
  EXPECT_NE(line_plot_svg(plot), svg);
}

TEST(LinePlot, WithoutDataIsEmpty) {
  EXPECT_EQ(line_plot_svg({}), "");
  LinePlot plot;
  plot.log_y = true;
  plot.series.push_back({"", {0.0, 1.0}, {0.0, -1.0}, 0});
  EXPECT_EQ(line_plot_svg(plot), "");
}

TEST(MapPlot, OmitsEmptyCellsAndDrawsEachShadeOnce) {
  MapPlot plot;
  plot.cells = {{0.0, 0.5, 0.0, 0.5, 1.0},
                {0.5, 1.0, 0.0, 0.5, 1.0},
                {0.0, 0.5, 0.5, 1.0, 10.0},
                {0.5, 1.0, 0.5, 1.0, std::numeric_limits<double>::quiet_NaN()}};
  const std::string svg = map_plot_svg(plot);
  EXPECT_THAT(svg, HasSubstr("<path class=\"m0\""));
  EXPECT_THAT(svg, HasSubstr("<path class=\"m8\""));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_EQ(map_plot_svg({}), "");
}

TEST(Shape, CubicSpringIsForceAgainstDeflection) {
  Experiment e;
  e.largest.displacement_m = 0.01;
  e.largest.velocity_m_s = 0.1;
  e.period_s = 0.001;
  e.samples = 1000;
  const physics::Effect& cubic = *physics::find_effect("cubic_stiffness");
  const std::vector<double> k3 = {7000.0};
  const auto curves = shape_of(cubic, k3, e);
  ASSERT_EQ(curves.size(), 1U);
  EXPECT_EQ(curves[0].variable, "displacement");
  EXPECT_NEAR(curves[0].value.back(), 7000.0 * 1.0e-6, 1.0e-12);
}

Experiment small_experiment() {
  Experiment e;
  e.largest.displacement_m = 0.01;
  e.largest.velocity_m_s = 0.1;
  e.period_s = 0.001;
  e.samples = 1000;
  e.mean_load_n = 0.2;
  e.channel_std.fill(0.01);
  return e;
}

std::vector<Curve> portrait(const char* id, const physics::Place& place,
                            const std::vector<double>& parameters) {
  return portrait_of(*physics::find_effect(id), place, parameters, parameters, small_experiment(),
                     0.1);
}

TEST(Portrait, EffectWithMemoryIsALoop) {
  const auto curves = portrait("hysteresis", {}, {50.0, 0.1, 0.0, 1.0});
  ASSERT_EQ(curves.size(), 1U);
  EXPECT_EQ(curves[0].variable, "displacement");
  // Full slip: the force approaches the slip force in both directions.
  const auto [least, most] = std::minmax_element(curves[0].value.begin(), curves[0].value.end());
  EXPECT_NEAR(*most, 0.1, 0.01);
  EXPECT_NEAR(*least, -0.1, 0.01);
}

TEST(Portrait, SensorErrorIsPlottedAsReadingAgainstTrueValue) {
  const auto gain = portrait("gain_error", {Channel::velocity, {}}, {1.2});
  ASSERT_EQ(gain.size(), 1U);
  EXPECT_EQ(gain[0].quantity, "reading");
  EXPECT_NEAR(gain[0].value.back(), 1.2 * gain[0].at.back(), 1.0e-12);
  const auto clipped = portrait("clipping", {Channel::displacement, {}}, {0.005});
  ASSERT_EQ(clipped.size(), 1U);
  EXPECT_NEAR(clipped[0].value.back(), 0.005, 1.0e-12);
}

TEST(Portrait, FrictionMemoryIsTheResponseToAReversal) {
  const auto curves = portrait("friction_memory", {}, {100.0, 0.0});
  ASSERT_EQ(curves.size(), 1U);
  EXPECT_NEAR(curves[0].value.front(), -1.0, 1.0e-12);
  EXPECT_NEAR(curves[0].value.back(), 1.0 - 2.0 * std::exp(-5.0), 1.0e-9);
}

TEST(Bands, FollowTheCorrelationOfTheParameters) {
  // value = a + b x with a and b one standard deviation of 1 each.
  const std::vector<Curve> line = {{"x", "m", "y", "N", {0.0, 1.0}, {0.0, 0.0}}};
  const auto changed = [&](Eigen::Index i, double by) {
    std::vector<Curve> out = line;
    for (std::size_t k = 0; k < 2; ++k) out[0].value[k] = i == 0 ? by : by * out[0].at[k];
    return out;
  };
  Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(2, 2);
  std::vector<Curve> free = line;
  add_bands(free, correlation, changed);
  EXPECT_NEAR(free[0].high[0], 1.96, 1.0e-12);
  EXPECT_NEAR(free[0].high[1], 1.96 * std::sqrt(2.0), 1.0e-12);
  correlation(0, 1) = correlation(1, 0) = -1.0;
  std::vector<Curve> bound = line;
  add_bands(bound, correlation, changed);
  EXPECT_NEAR(bound[0].high[1], 0.0, 1.0e-12);
  EXPECT_NEAR(bound[0].low[0], -1.96, 1.0e-12);
}

}  // namespace
}  // namespace stickslip::report
