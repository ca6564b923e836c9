#include "tools/diagnose/report_html.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "physics/effects/catalogue.h"
#include "tools/diagnose/picture.h"

namespace stickslip::diagnosis {
namespace {

using testing::HasSubstr;
using testing::Not;

Diagnosis with_a_finding() {
  Diagnosis d;
  d.verdict = Verdict::missing_physics;
  d.location = Location{physics::Relation::force_balance,
                        Channel::displacement,
                        {{0.0, 30.0}},
                        {},
                        std::nullopt,
                        "They part in the force balance of the mass.",
                        {{.channel = Channel::displacement,
                          .aspect = Aspect::displacement,
                          .from = 0.01,
                          .to = 0.02,
                          .words = "at displacements from 0.01 to 0.02 m",
                          .energy = 16.0,
                          .energy_outside = 1.0,
                          .p_value = 1.0e-9}}};
  Finding finding;
  finding.effect = physics::find_effect("cubic_stiffness");
  finding.statement = "The spring hardens.";
  finding.parameters = {{"k3_n_m3", 700.0, 680.0, 720.0}};
  finding.probability = 0.9;
  finding.alternatives = {{Suspect{physics::find_effect("end_stop"), {}}, 0.1}};
  finding.separating_experiment = "stepped amplitudes";
  finding.shape = {
      {"displacement", "m", "force against +x", "N", {-0.01, 0.0, 0.01}, {-0.007, 0.0, 0.007}}};
  d.findings.push_back(finding);
  d.baseline.chi2_per_sample = 9.5;
  d.augmented = d.baseline;
  d.augmented->chi2_per_sample = 1.02;
  d.horizon_s = 0.4;
  Integrity integrity;
  integrity.source = "run.csv";
  integrity.channels = {{.channel = Channel::displacement}};
  integrity.remarks = {"a clipped channel"};
  d.integrity = {integrity};
  Evidence evidence;
  ChannelEvidence channel;
  channel.window_time_s = {0.5, 1.0};
  channel.window_before = {9.0, 10.0};
  channel.window_after = {1.0, 1.1};
  channel.frequency_hz = {0.0, 1.0, 2.0};
  channel.power_before = {5.0, 4.0, 1.0};
  channel.power_after = {1.0, 1.0, 1.0};
  channel.time_s = {0.0, 0.1, 0.2};
  channel.recorded = channel.before = channel.after = {0.0, 0.001, 0.0};
  evidence.channels.push_back(channel);
  evidence.map.displacement_m = 0.01;
  evidence.map.velocity_m_s = 0.1;
  evidence.map.before.assign(PhaseMap::cells * PhaseMap::cells, 3.0);
  evidence.map.after.assign(PhaseMap::cells * PhaseMap::cells, 1.0);
  d.evidence = evidence;
  return d;
}

Provenance provenance() {
  return {"stickslip diagnose <odd> & name.csv --model m.toml",
          "1.2.3",
          42,
          {{"<odd> & name.csv", "abc123"}}};
}

TEST(ReportHtml, SaysWhatWasFoundHowSureAndHowToRepeatIt) {
  const std::string page = report_html(with_a_finding(), provenance());
  for (const char* part :
       {"Missing physics: hardening or softening spring", "They part in the force balance",
        "9.5 → 1.02", "90 %", "k3_n_m3", "680", "720", "end_stop", "stepped amplitudes",
        "force against +x over displacement", "Phase space", "seed 42", "1.2.3", "abc123",
        "at displacements from 0.01 to 0.02 m", "a clipped channel"}) {
    EXPECT_THAT(page, HasSubstr(part));
  }
}

TEST(ReportHtml, LoadsNothingFromElsewhereAndTakesNoNameForMarkup) {
  const std::string page = report_html(with_a_finding(), provenance());
  for (const char* part : {"http://", "https://", "src=", "@import", "url(", "<script", "<odd>"}) {
    EXPECT_THAT(page, Not(HasSubstr(part)));
  }
  EXPECT_THAT(page, HasSubstr("&lt;odd&gt; &amp; name.csv"));
}

TEST(ReportHtml, IsTheSameForTheSameDiagnosis) {
  EXPECT_EQ(report_html(with_a_finding(), provenance()),
            report_html(with_a_finding(), provenance()));
}

TEST(ReportHtml, AConsistentRecordingHasNoFindings) {
  Diagnosis d;
  d.baseline.chi2_per_sample = 1.0;
  const std::string page = report_html(d, provenance());
  EXPECT_THAT(page, HasSubstr("Consistent: nothing beyond the noise"));
  EXPECT_THAT(page, Not(HasSubstr("What was left out")));
}

TEST(LinePlot, LeavesOutWhatIsNoNumberAndKeepsEverySpike) {
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
  // 20000 points are drawn by at most two a pixel.
  EXPECT_LT(svg.size(), 60000U);
  plot.series[0].y[12345] = 0.0;
  EXPECT_NE(line_plot_svg(plot), svg);
}

TEST(LinePlot, OfNothingIsNothing) {
  EXPECT_EQ(line_plot_svg({}), "");
  LinePlot plot;
  plot.log_y = true;
  plot.series.push_back({"", {0.0, 1.0}, {0.0, -1.0}, 0, false});
  EXPECT_EQ(line_plot_svg(plot), "");
}

TEST(Shape, OfACubicSpringIsItsForceOverDeflection) {
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

}  // namespace
}  // namespace stickslip::diagnosis
