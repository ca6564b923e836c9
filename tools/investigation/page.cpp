// SPDX-License-Identifier: Apache-2.0
#include "tools/investigation/page.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "diagnosis/report/formatting.h"
#include "diagnosis/report/html.h"
#include "diagnosis/report/html_elements.h"
#include "diagnosis/report/plot_svg.h"
#include "diagnosis/report/standalone_svg.h"
#include "physics/number_text.h"
#include "tools/investigation/decision.h"

namespace stickslip::investigation {

namespace {

using physics::number_text;
using physics::percent_text;
using report::code;
using report::escape_html;
using report::paragraph;
using report::plain_text;

// "missing physics"
std::string verdict_words(const Step& step) {
  if (step.partial) return "part of the missing physics";
  std::string out = step.verdict;
  std::replace(out.begin(), out.end(), '_', ' ');
  return out;
}

bool is_found(const Step& step, const Standing& each) {
  return std::find(step.findings.begin(), step.findings.end(), each.name) != step.findings.end();
}

struct PeakRow {
  std::string quantity;
  std::string reached;
  std::string limit;
};

std::string with_unit(double value, const std::string& unit) {
  return number_text(value, 3) + " " + unit;
}

// Largest values of a run, over all models and stiffnesses, beside what is allowed.
std::vector<PeakRow> peak_rows(const Question& q, const RigFacts& facts) {
  std::vector<PeakRow> out;
  const auto drive = [&](const char* name, double reached, double limit, const char* unit) {
    if (std::isfinite(limit))
      out.push_back({name, with_unit(reached, unit), with_unit(limit, unit)});
  };
  drive(facts.force ? "force of the drive" : "base displacement", q.peaks.value, facts.limits.value,
        facts.force ? "N" : "m");
  drive(facts.force ? "slew of the drive" : "base velocity", q.peaks.first, facts.limits.first,
        facts.force ? "N/s" : "m/s");
  drive("base acceleration", q.peaks.second, facts.limits.second, "m/s^2");
  for (const Channel channel : all_channels) {
    const std::size_t c = index_of(channel);
    const bool low = std::isfinite(facts.ranges.low[c]);
    const bool high = std::isfinite(facts.ranges.high[c]);
    if (!low && !high) continue;
    const std::string unit(info(channel).unit);
    std::string name(info(channel).stem);
    if (channel == Channel::displacement && facts.displacement_range_assumed) {
      name += " (range assumed)";
    }
    out.push_back(
        {name, number_text(q.extent.lowest[c], 3) + " to " + with_unit(q.extent.highest[c], unit),
         (low ? number_text(facts.ranges.low[c], 3) : "any") + " to " +
             (high ? with_unit(facts.ranges.high[c], unit) : "any")});
  }
  return out;
}

// The pairs that a run is expected to separate, the farthest first.
std::vector<Expected> largest_first(std::vector<Expected> expected) {
  std::stable_sort(expected.begin(), expected.end(),
                   [](const Expected& a, const Expected& b) { return a.nats > b.nats; });
  expected.resize(std::min<std::size_t>(expected.size(), 4));
  return expected;
}

std::string gain_words(const Question& q) {
  if (q.expected.empty()) return "no hypothesis to separate yet";
  return "expected to resolve " + percent_text(q.gain) + " of the remaining uncertainty";
}

std::string links_of(const Step& step) {
  const std::string folder = escape_html(step.name);
  std::string out = "<p><a href=\"" + folder + "/drive.svg\">the drive</a>";
  if (step.answered) out += ", <a href=\"" + folder + "/report.html\">the diagnosis after it</a>";
  return out + "</p>\n";
}

report::Section questions_section(const Study& study) {
  report::Section out("questions", "Questions and answers");
  for (const Step& step : study.steps) {
    const Question& q = step.question;
    out += "<h3>" + escape_html(step.name) + "</h3>\n" +
           paragraph("Question: " + q.words + "; " + gain_words(q) + ".") + links_of(step);
    report::Table peaks("Over all models that were possible, with stiffnesses up to 30 % off.",
                        {"quantity", "at most", "allowed"});
    for (const PeakRow& row : peak_rows(q, study.facts)) {
      peaks.row({escape_html(row.quantity), escape_html(plain_text(row.reached)),
                 escape_html(plain_text(row.limit))});
    }
    out += peaks.html();
    if (!q.expected.empty()) {
      report::Table pairs("Expected difference of the log predictive densities.",
                          {"if true", "against", "nat"});
      for (const Expected& each : largest_first(q.expected)) {
        pairs.row({escape_html(each.truth), escape_html(each.other),
                   number_text(each.nats, 3) + " \u00b1 " + number_text(each.error, 2)});
      }
      out += pairs.html();
    }
    if (!step.answered) {
      out += paragraph("Recorded, and not diagnosed yet.");
      continue;
    }
    report::Table answer("Answer: " + verdict_words(step) + ", held-out chi-squared per sample " +
                             number_text(step.chi2, 3) + ", from all recordings so far.",
                         {"hypothesis", "probability", "", "in the model"});
    for (const Standing& each : step.standing) {
      answer.row({escape_html(each.name), escape_html(report::format_percent(each.probability)),
                  "<div class=\"bar\">" + report::bar(each.probability) + "</div>",
                  is_found(step, each) ? "yes" : "no"});
    }
    out += answer.html();
    for (const Standing& each : step.standing) {
      if (is_found(step, each) || step.findings.empty()) {
        out += paragraph(plain_text(each.statement), "soft");
      }
    }
  }
  return out;
}

// One line for each hypothesis that was ever among the four most probable.
report::Section probabilities_section(const Study& study) {
  report::Section out("probabilities", "Probabilities over the runs");
  std::map<std::string, report::Series> lines;
  for (std::size_t i = 0; i < study.steps.size(); ++i) {
    for (const Standing& each : study.steps[i].standing) {
      report::Series& line = lines[each.name];
      line.name = each.name;
      line.x.push_back(static_cast<double>(i + 1));
      line.y.push_back(each.probability);
    }
  }
  report::LinePlot plot;
  plot.title = "Probabilities";
  plot.description = "Probability of each hypothesis after each run.";
  plot.x_label = "run";
  plot.y_label = "probability";
  int style = 0;
  for (auto& [name, line] : lines) {
    const double most = *std::max_element(line.y.begin(), line.y.end());
    if (most < 0.05 || plot.series.size() >= 4) continue;
    line.style = style++;
    plot.series.push_back(line);
  }
  if (study.steps.size() > 1) {
    out += report::figure(report::line_plot_svg(plot),
                          "Of the hypotheses that had 5 % or more after some run.");
  }
  return out;
}

report::Section repeat_section() {
  report::Section out("repeat", "Reproduction");
  out += "<p>From the recordings alone: " + code("stickslip investigate --repeat FOLDER") +
         ". One diagnosis of all of them: " +
         code("stickslip diagnose --campaign FOLDER/campaign.toml") + ".</p>\n";
  return out;
}

}  // namespace

std::string question_text(const Question& q, const RigFacts& facts) {
  std::string out = "run: " + q.words + "\n";
  for (const PeakRow& row : peak_rows(q, facts)) {
    out += "  " + row.quantity + ": at most " + row.reached + ", allowed " + row.limit + "\n";
  }
  out += "  " + gain_words(q) + "\n";
  for (const Expected& each : largest_first(q.expected)) {
    out += "    if " + each.truth + ", against " + each.other + ": " + number_text(each.nats, 3) +
           " nat\n";
  }
  return out;
}

std::string answer_text(const Step& step) {
  std::string out = step.name + ": " + verdict_words(step) + "\n";
  for (const Standing& each : step.standing) {
    out += "  " + probability_text(each.probability) + "  " + each.name + "\n";
  }
  return out;
}

std::string picture_of(const design::Drive& drive, const Question& question,
                       const RigFacts& facts) {
  report::LinePlot plot;
  plot.title = question.words;
  plot.description = "The drive over time, with its limits.";
  plot.x_label = "time [s]";
  plot.y_label = facts.force ? "force [N]" : "base displacement [m]";
  report::Series line;
  line.name = "drive";
  for (std::size_t k = 0; k < drive.samples.size(); ++k) {
    line.x.push_back(drive.period_s * static_cast<double>(k));
    line.y.push_back(drive.samples[k]);
  }
  plot.series.push_back(line);
  plot.levels = {{facts.limits.value, "limit"}, {-facts.limits.value, "limit"}};
  plot.width = 900.0;
  return report::standalone_svg(report::line_plot_svg(plot));
}

namespace {

// The findings of the last diagnosis, and the hypotheses that it leaves possible.
std::string result_words(const Study& study) {
  const auto last = std::find_if(study.steps.rbegin(), study.steps.rend(),
                                 [](const Step& step) { return step.answered; });
  if (last == study.steps.rend()) return "";
  std::string out = "Result after " + last->name + ": " + verdict_words(*last);
  if (!last->findings.empty()) {
    out += ", " + report::enumeration(last->findings) + ", with a probability of " +
           least_words(*last);
  }
  std::vector<std::string> others;
  for (const Standing& each : last->standing) {
    if (is_found(*last, each)) continue;
    others.push_back(report::with_probability(each.name, percent_text(each.probability)));
  }
  return out + (others.empty() ? "." : "; also possible: " + report::enumeration(others) + ".");
}

}  // namespace

std::string page_of(const Study& study) {
  std::string first = "<h1>Study of " + escape_html(study.facts.name) + "</h1>\n";
  if (const std::string words = result_words(study); !words.empty()) {
    first += "<p><b>" + escape_html(words) + "</b></p>\n";
  }
  const std::string time = number_text(study.rig_time_s(), 4) + " s of rig time in " +
                           physics::counted(study.steps.size(), "run");
  first += paragraph(study.ending == Ending::open
                         ? "Not ended: " + time + " so far."
                         : "Ended after " + time + ": " + study.ending_words + ".");
  first += "<p>Believed at the start: the declared model, " + code("model.toml") +
           ", and that nothing is missing from it.</p>\n";
  return report::html_page(
      "Study of " + study.facts.name, first,
      {questions_section(study), probabilities_section(study), repeat_section()});
}

}  // namespace stickslip::investigation
