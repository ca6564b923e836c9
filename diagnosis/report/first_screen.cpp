// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/report/first_screen.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "diagnosis/report/formatting.h"
#include "diagnosis/report/headline.h"
#include "diagnosis/report/html_elements.h"
#include "diagnosis/report/text.h"
#include "physics/number_text.h"

namespace stickslip::report {

using namespace diagnosis;
using physics::ResultUnits;

namespace {

std::string answer(const std::string& question, const std::string& html) {
  return "<div><dt>" + escape_html(question) + "</dt><dd>" + html + "</dd></div>\n";
}

std::string first_parameter(const Finding& finding, const ResultUnits& units) {
  if (finding.parameters.empty()) return "";
  const Estimate& first = finding.parameters.front();
  const EstimateText estimate = format_estimate(first.value, first.low, first.high);
  const physics::ParameterCard* card = parameter_card(finding, first);
  const std::string unit = card != nullptr ? unit_text(card->unit, finding.place, units) : "";
  std::string out = " ";
  out += code(first.name) + " = <span class=\"number\">" + estimate.value + "</span>";
  if (!unit.empty()) out += escape_html("\u00a0" + unit);
  return out + " (95\u00a0%: " + interval_text(first) + ").";
}

std::string findings_answer(const Diagnosis& d) {
  if (d.findings.empty()) {
    return escape_html(d.verdict == Verdict::consistent
                           ? "None found. No effect that was tested improves the prediction "
                             "significantly."
                           : "Not known. No effect of the catalogue explains the difference.");
  }
  std::string out;
  for (const Finding& finding : d.findings) {
    out += "<p>" + escape_html(plain_text(finding.statement)) +
           first_parameter(finding, ResultUnits(d.model)) + "</p>";
  }
  return out;
}

std::string where_answer(const Diagnosis& d) {
  if (!d.location) {
    return escape_html(
        "Nowhere: in every channel, at all times, speeds and deflections, the residual is noise.");
  }
  std::string out = escape_html(plain_text(d.location->statement));
  for (const Region& worst : d.location->regions) {
    if (d.location->channel && worst.channel != *d.location->channel) continue;
    out += escape_html(" Most significant: " + channel_name(worst.channel) + " " +
                       plain_text(worst.words) + ", " + format_number(std::sqrt(worst.energy)) +
                       " times the noise (elsewhere " +
                       format_number(std::sqrt(worst.energy_outside)) + ").");
    break;
  }
  return out;
}

// The trial in which the finding was fitted alone, or nullptr.
const Trial* trial_of(const Diagnosis& d, const Finding& finding) {
  const std::string name = finding.name();
  for (const Trial& trial : d.trials) {
    if (trial.id == name) return &trial;
  }
  return nullptr;
}

std::string windows_text(const Diagnosis& d) {
  return physics::counted(d.windows.report, "held-out window") + " of " +
         format_seconds(d.horizon_s, ResultUnits(d.model));
}

std::string probability_of(const Diagnosis& d, const Finding& finding) {
  const auto explanation = [](const CandidateEffect& effect, double probability) {
    return with_probability(escape_html(effect_name(effect)),
                            "<b>" + escape_html(format_percent(probability)) + "</b>");
  };
  const std::size_t named = has_rival(finding) ? 1 : 0;
  std::string out = "<p>Likely missing: " + explanation(finding, finding.probability);
  if (named == 1) {
    const Alternative& rival = finding.alternatives.front();
    out += " or " + explanation(rival.candidate, rival.probability);
  }
  out += ".";
  if (finding.alternatives.size() > named) {
    const Alternative& next = finding.alternatives[named];
    out += escape_html(
        " Also possible: " +
        with_probability(effect_name(next.candidate), format_percent(next.probability)) + ".");
  }
  const Trial* trial = trial_of(d, finding);
  if (trial != nullptr && trial->stage == 0 && trial->gain_z > 0.0) {
    const std::string errors = format_number(trial->gain_z, 2) + " standard errors over the " +
                               std::to_string(d.windows.select) + " selection windows";
    out += escape_html(trial->gain_z < significant_gain_z
                           ? " Its gain alone, " + errors + ", is not significant."
                           : " It improves the prediction by " + errors + ".");
  }
  if (!finding.preferred_over.empty()) {
    out += escape_html(" It is the simpler or the listed one: " +
                       effect_name(finding.preferred_over.front()) + " scores better.");
  }
  return out + "</p>";
}

std::string confidence_answer(const Diagnosis& d) {
  if (!d.findings.empty()) {
    std::string out;
    for (const Finding& finding : d.findings) out += probability_of(d, finding);
    return out;
  }
  if (d.verdict == Verdict::unexplained) {
    return escape_html("The mismatch is significant: over " + windows_text(d) +
                       " the residuals exceed the noise.");
  }
  std::string out = escape_html("The model was tested on " + windows_text(d) + ". ");
  if (d.false_alarms) out += escape_html(false_alarm_text(*d.false_alarms) + " ");
  if (!d.detection.limits.empty()) {
    out += escape_html("Detection limits are available for " +
                       std::to_string(d.detection.limits.size()) + " effects.");
  }
  return out;
}

// The first predicted channel stands for all; the table of the section lists the others.
std::string prediction_error(const Diagnosis& d) {
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (!d.baseline.rmse[c]) continue;
    const ResultUnits units(d.model);
    const std::string_view unit = units.of(channel_table[c].unit);
    std::string out = escape_html(" RMS prediction error of the " + channel_name(all_channels[c]) +
                                  ", up to " + format_seconds(d.horizon_s, units) + " ahead: ") +
                      format_quantity(*d.baseline.rmse[c], unit);
    if (d.augmented && d.augmented->rmse[c]) {
      out += " \u2192 " + format_quantity(*d.augmented->rmse[c], unit, *d.baseline.rmse[c]);
    }
    for (const auto& [measured, noise] : d.noise_std) {
      if (measured != all_channels[c]) continue;
      const Noise* judged = noise_of(d, measured);
      out += "; noise " +
             format_quantity(judged != nullptr ? judged->std : noise, unit, *d.baseline.rmse[c]);
    }
    return out + ".";
  }
  return "";
}

std::string fit_answer(const Diagnosis& d) {
  std::string out = "<b>" + format_number(d.baseline.chi2_per_sample);
  if (d.augmented) out += " \u2192 " + format_number(d.augmented->chi2_per_sample);
  out += "</b> " +
         escape_html(d.augmented ? "chi-squared per sample, declared \u2192 augmented "
                                   "model (1: noise only)."
                                 : "chi-squared per sample (1: noise only).") +
         escape_html(fit_remark(d));
  return out + prediction_error(d);
}

// A selection: listed physics of the rig only.
std::string limits_answer(const Diagnosis& d) {
  constexpr std::size_t most = 5;
  std::vector<std::string> limits;
  for (const DetectionLimit& limit : d.detection.limits) {
    const physics::Card& card = limit.candidate.effect->card();
    if (!card.depends_on.empty() || limit.candidate.place.channel || limits.size() == most)
      continue;
    const std::string unit =
        unit_text(limit.parameter().unit, limit.candidate.place, ResultUnits(d.model));
    limits.push_back(escape_html(effect_name(limit.candidate)) + " (" +
                     code(limit.parameter().name) + " = " +
                     escape_html(plain_text(limit_text(limit))) +
                     escape_html(unit.empty() ? unit : "\u00a0" + unit) + ")");
  }
  if (limits.empty()) return "";
  std::string out;
  for (std::size_t i = 0; i < limits.size(); ++i) out += (i > 0 ? ", " : "") + limits[i];
  return out + "; all: <a href=\"#detection\">detection limits</a>.";
}

std::string next_answer(const Diagnosis& d) {
  switch (answer_of(d)) {
    case Answer::ambiguous:
      for (const Finding& finding : d.findings) {
        if (finding.separating_experiment) {
          return escape_html("To discriminate: " + plain_text(*finding.separating_experiment) +
                             ".");
        }
      }
      return escape_html(
          "Record more data, or under a different excitation: these data do not discriminate "
          "between the explanations.");
    case Answer::unexplained:
      return escape_html(
          "See in the figures below when and where the model fails, check the recording "
          "(saturation, lost samples and mains lines are listed), and check the parameters that "
          "the model declares as exact.");
    case Answer::named:
      return escape_html(
          "Test the augmented model on another recording: diagnose with --write-model, then "
          "stickslip evaluate.");
    case Answer::partial:
      return escape_html(
          "Diagnose with the augmented model (--write-model) as the declared one, on this and on a "
          "longer recording: what is left shows in the residuals below.");
    case Answer::consistent:
      break;
  }
  return escape_html(
      "None is needed for this recording. A longer one, or one with larger amplitudes and other "
      "frequencies, would show smaller effects.");
}

const char* verdict_text(Answer kind) {
  switch (kind) {
    case Answer::consistent:
      return "Verdict: consistent";
    case Answer::named:
      return "Verdict: missing physics, identified";
    case Answer::partial:
      return "Verdict: missing physics, not all of it identified";
    case Answer::ambiguous:
      return "Verdict: missing physics, more than one explanation";
    case Answer::unexplained:
      break;
  }
  return "Verdict: unexplained";
}

const char* style_of(Answer kind) {
  switch (kind) {
    case Answer::consistent:
      return "consistent";
    case Answer::named:
      return "named";
    case Answer::partial:
    case Answer::ambiguous:
      return "ambiguous";
    case Answer::unexplained:
      break;
  }
  return "unexplained";
}

std::string subject_of(const Diagnosis& d, const Provenance& provenance) {
  std::string out =
      "<p class=\"soft\">" + escape_html(d.integrity.size() > 1 ? "Recordings " : "Recording ");
  // Behind the recordings: the model, and the campaign if there is one.
  const std::size_t model = std::max<std::size_t>(1, d.integrity.size());
  for (std::size_t i = 0; i < provenance.files.size(); ++i) {
    if (i > 0) out += i < model ? ", " : i == model ? ", model " : ", campaign ";
    out += code(provenance.files[i].name);
  }
  double seconds = 0.0;
  for (const Integrity& each : d.integrity) seconds += each.duration_s;
  if (seconds > 0.0)
    out += escape_html("; " + format_number(seconds) + ResultUnits(d.model).after_number("s") +
                       " recorded");
  return out +
         escape_html(". Declared physics, with the fitted parameters: " +
                     rig_description(d.model)) +
         "</p>\n";
}

}  // namespace

std::string first_screen(const Diagnosis& d, const Provenance& provenance) {
  const Answer kind = answer_of(d);
  std::string out = "<header class=\"" + std::string(style_of(kind)) +
                    "\">\n<div class=\"verdict\">\n<p class=\"kicker\">" + verdict_text(kind) +
                    "</p>\n<h1>" + escape_html(headline_of(d)) + "</h1>\n</div>\n" +
                    subject_of(d, provenance) + "<dl class=\"answers\">\n";
  out += answer("Missing physics", findings_answer(d));
  out += answer("Next step", next_answer(d));
  out += answer("Location of the mismatch", where_answer(d));
  out += answer("Confidence", confidence_answer(d));
  out += answer("Held-out fit", fit_answer(d));
  const std::string limits = kind == Answer::consistent ? limits_answer(d) : "";
  if (!limits.empty()) out += answer("Detection limits (95 %)", limits);
  return out + "</dl>\n</header>\n";
}

}  // namespace stickslip::report
