// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/report/html.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "diagnosis/report/campaign.h"
#include "diagnosis/report/figures.h"
#include "diagnosis/report/first_screen.h"
#include "diagnosis/report/formatting.h"
#include "diagnosis/report/headline.h"
#include "diagnosis/report/html_elements.h"
#include "diagnosis/report/style.h"
#include "diagnosis/report/text.h"
#include "physics/number_text.h"

namespace stickslip::report {

using namespace diagnosis;
using physics::ResultUnits;

namespace {

std::string parameter_table(const Finding& finding, const ResultUnits& units) {
  Table table(
      "Parameters with 95 % intervals of the fit. Formula: one standard deviation by which the "
      "formula itself may be wrong.",
      {"meaning", "name", "value", "95 % interval", "formula", "unit"});
  for (const Estimate& each : finding.parameters) {
    const EstimateText text = format_estimate(each.value, each.low, each.high);
    const physics::ParameterCard* card = parameter_card(finding, each);
    const std::string unit = card != nullptr ? unit_text(card->unit, finding.place, units) : "";
    table.row({card != nullptr ? escape_html(std::string(card->meaning)) : "", code(each.name),
               text.value, interval_text(each),
               is_undetermined(each) ? std::string()
                                     : "\u00b1 " + format_number(each.formula_uncertainty, 2),
               escape_html(unit.empty() ? "none" : unit)});
  }
  return table.html();
}

std::string score_table(const Finding& finding) {
  Table table("Score on the selection windows, with its standard error.",
              {"quantity", "without the finding", "with it"});
  table.row({"chi-squared per sample", format_number(finding.chi2_before),
             format_number(finding.chi2_after)});
  table.row({"gain [nat]", "",
             format_number(finding.gain.value) + " \u00b1 " + format_number(finding.gain.se)});
  return table.html();
}

std::string alternative_table(const Finding& finding) {
  Table table(
      "Alternatives: the candidates that explain most, with their relative probabilities. Those "
      "below 0.5 % are not listed.",
      {"candidate", "name", "probability", ""});
  const auto row = [&](const CandidateEffect& candidate, double probability) {
    table.row({escape_html(effect_name(candidate)), code(id_of(candidate)),
               escape_html(format_percent(probability)),
               "<div class=\"bar\">" + bar(probability) + "</div>"});
  };
  row(finding, finding.probability);
  for (const Alternative& each : finding.alternatives) row(each.candidate, each.probability);
  return table.html();
}

Section findings_section(const Diagnosis& d) {
  Section out("findings", "Missing physics");
  const ResultUnits units(d.model);
  int number = 0;
  out += friction_figures(d);
  for (const Finding& finding : d.findings) {
    const physics::Card& card = finding.effect->card();
    out += "<h3>" + std::to_string(++number) + ". " + escape_html(effect_name(finding)) +
           "</h3>\n" + paragraph(plain_text(finding.statement));
    out += paragraph(std::string(card.sentence), "soft");
    out += "<p>Equation: " + code(card.equation) + "</p>\n";
    if (finding.when_s) {
      out += paragraph("Active from " + format_number(finding.when_s->first) + " to " +
                       format_number(finding.when_s->second) + units.after_number("s") + ".");
    }
    out += paragraph(
        "Chi-squared per sample on the selection windows: " + format_number(finding.chi2_before) +
        " \u2192 " + format_number(finding.chi2_after) + ", a gain of " +
        format_number(finding.gain.value) + " \u00b1 " + format_number(finding.gain.se) + " nat.");
    out += score_table(finding);
    out += parameter_table(finding, units);
    out += shape_figures(finding);
    out += alternative_table(finding);
    if (finding.separating_experiment) {
      out += "<p><b>To discriminate:</b> " +
             escape_html(plain_text(*finding.separating_experiment)) + ".</p>\n";
    } else if (!card.experiment.empty()) {
      out += paragraph("To isolate the effect: " + std::string(card.experiment) + ".", "soft");
    }
  }
  return out;
}

// The recordings and the noise that the figures do not show.
std::string evidence_remark(const Diagnosis& d) {
  std::string out;
  if (d.integrity.size() > 1) {
    out = " Of the recordings only the first is drawn, " + d.integrity.front().source + ".";
  }
  if (d.evidence->drive_noise_removed) {
    out += " The contribution of the measurement noise of the drive is removed.";
  }
  return out;
}

Section stretch_section(const Diagnosis& d) {
  Section out("recorded", "Recorded and simulated");
  const std::string figures = stretch_figures(d);
  if (figures.empty()) return out;
  const Evidence& evidence = *d.evidence;
  const auto span = [&](const Stretch& stretch) {
    return format_number(evidence.windows[stretch.first].begin_s, 4) + " to " +
           format_number(evidence.windows[stretch.first + stretch.count - 1].end_s, 4) +
           ResultUnits(d.model).after_number("s");
  };
  const bool has_typical = evidence.typical.count > 0;
  out += paragraph(
      (has_typical ? "Left: " : "Shown: ") + span(evidence.worst) +
      ", with the held-out window in which the declared model fits worst." +
      (has_typical ? " Right: " + span(evidence.typical) + ", with a typical one." : "") +
      " Dotted lines: start of a window, with an initial state fitted to that window alone." +
      evidence_remark(d));
  out += figures;
  Table table("Mean square of the residuals of the declared model over that of the noise.",
              {"windows", "chi-squared per sample"});
  table.row({"worst, shown", format_number(evidence.worst.before)});
  if (has_typical) table.row({"typical, shown", format_number(evidence.typical.before)});
  table.row({"median of single windows", format_number(evidence.median)});
  out += table.html();
  return out;
}

std::string region_table(const Diagnosis& d) {
  if (!d.location || d.location->regions.empty()) return "";
  constexpr std::size_t most = 12;
  const auto& regions = d.location->regions;
  Table table(
      "Conditions under which the residuals of the declared model are larger than elsewhere: "
      "RMS residual over noise. False discovery rate at most 5 % (Benjamini-Yekutieli, block "
      "bootstrap over windows).",
      {"channel", "condition", "RMS residual / noise", "elsewhere"});
  for (std::size_t i = 0; i < std::min(most, regions.size()); ++i) {
    table.row({escape_html(channel_name(regions[i].channel)),
               escape_html(plain_text(regions[i].words)),
               format_number(std::sqrt(regions[i].energy)),
               format_number(std::sqrt(regions[i].energy_outside))});
  }
  return table.html();
}

std::string balance_table(const Diagnosis& d) {
  if (!d.location) return "";
  constexpr std::array<const char*, balance_count> equations = {
      "velocity against the derivative of the displacement",
      "inertia, damping, spring, friction and drive",
      "friction against its law at the measured velocity and load",
      "normal load against its law",
      "drive above its own frequencies",
  };
  Table table(
      "Balances of the readings, before any effect was tried: residual energy over that of a "
      "simulated recording of the calibrated declared model, and the probability of as much from "
      "noise and calibration.",
      {"balance", "of", "excess", "p"});
  for (const Balance each : all_balances) {
    const auto& found = d.location->balances[each];
    std::string name(name_of(each));
    std::replace(name.begin(), name.end(), '_', ' ');
    table.row({escape_html(name), escape_html(equations[index_of(each)]),
               found ? format_number(found->excess) : escape_html("not measured"),
               found ? format_number(found->p, 1) : ""});
  }
  return table.html();
}

Section residual_section(const Diagnosis& d) {
  Section out("where", d.verdict == Verdict::consistent ? "Residuals" : "Location and residuals");
  const std::string figures = residual_figures(d);
  if (!figures.empty()) {
    out += paragraph(
        "Shown: recording minus simulation, divided by the noise of the channel; 1 is noise "
        "only. The figures show all windows, fitted and held out." +
        evidence_remark(d));
    out += figures;
  }
  out += balance_table(d);
  out += region_table(d);
  return out;
}

Section fit_section(const Diagnosis& d) {
  Section out("fit", "Held-out fit");
  const bool changed = d.augmented.has_value();
  const ResultUnits units(d.model);
  std::vector<std::string> headings = {"quantity", "declared model"};
  if (changed) headings.insert(headings.end(), {"augmented model", "ratio", ""});
  Table table("RMS prediction error up to " + format_seconds(d.horizon_s, units) + " ahead, over " +
                  physics::counted(d.windows.report, "held-out window") + "; " +
                  physics::counted(d.windows.fit, "other was", "others were") + " fitted, and " +
                  physics::counted(d.windows.select, "selects", "select") +
                  " among candidates. Bars: declared model above, augmented model below.",
              headings);
  const auto row = [&](const std::string& name, double before, std::optional<double> after,
                       std::string_view unit) {
    std::vector<std::string> cells = {escape_html(name), format_quantity(before, unit)};
    if (changed && after) {
      const double most = std::max({before, *after, 1.0e-300});
      cells.push_back(format_quantity(*after, unit, before));
      cells.push_back(format_number(100.0 * *after / std::max(before, 1.0e-300)) + "\u00a0%");
      cells.push_back("<div class=\"bar\">" + bar(before / most, "was") + bar(*after / most) +
                      "</div>");
    }
    table.row(cells);
  };
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (!d.baseline.rmse[c]) continue;
    row(channel_name(all_channels[c]), *d.baseline.rmse[c],
        changed ? d.augmented->rmse[c] : std::nullopt, units.of(channel_table[c].unit));
  }
  row("chi-squared per sample", d.baseline.chi2_per_sample,
      changed ? std::optional(d.augmented->chi2_per_sample) : std::nullopt, "1");
  out += table.html();
  return out;
}

Section calibration_section(const Diagnosis& d) {
  Section out("calibration", "Calibrated parameters");
  if (d.calibrated.empty()) return out;
  out += paragraph(
      "Parameters declared with a standard deviation are calibrated within it before an effect is "
      "considered missing.");
  const bool named_by_unit = !ResultUnits(d.model).dimensionless();
  Table table(std::string("Calibrated parameters with 95 % intervals") +
                  (named_by_unit ? "; the suffix of a name is its unit." : "."),
              {"parameter", "declared", "calibrated", "95 % interval",
               "shift in declared standard deviations"});
  for (const Calibration& each : d.calibrated) {
    const EstimateText text = format_estimate(each.value, each.low, each.high);
    const bool known = each.high > each.low;
    table.row({code(each.path),
               each.sigma > 0.0
                   ? format_number(each.declared, 4) + " \u00b1 " + format_number(each.sigma, 2)
                   : std::string(),
               text.value, known ? text.low + " to " + text.high : "not known",
               with_minus(shift_text(each.shift_sigmas))});
  }
  out += table.html();
  out += calibration_figure(d);
  return out;
}

std::string noise_source(const Diagnosis& d, Channel channel) {
  const bool estimated = std::find(d.noise_estimated.begin(), d.noise_estimated.end(), channel) !=
                         d.noise_estimated.end();
  const Noise* noise = noise_of(d, channel);
  const bool contradicted = noise != nullptr && noise->source == Noise::Source::contradicted;
  std::string out = "declared by the model";
  if (contradicted) out = "found; the model declares another";
  if (estimated) out = "estimated from the recording";
  if (noise == nullptr || !(noise->correlation_s > 0.0)) return out;
  return out + "; a slow part is correlated over " +
         format_seconds(noise->correlation_s, ResultUnits(d.model));
}

std::string noise_amount(const Diagnosis& d, Channel channel, double white) {
  // The least that is assumed of a channel that never changes.
  constexpr double invisible = 2.0e-15;
  const Noise* noise = noise_of(d, channel);
  const double value = noise != nullptr ? noise->std : white;
  if (value < invisible) return "none visible";
  return format_quantity(value, ResultUnits(d.model).of(info(channel).unit));
}

Section noise_section(const Diagnosis& d) {
  Section out("noise", "Noise floor");
  if (d.noise_std.empty()) return out;
  std::vector<std::string> headings = {"channel", "noise", "source"};
  if (!d.noise_level.empty()) headings.emplace_back("found / expected");
  Table table("Standard deviation of the measurement noise.", headings);
  for (const auto& [channel, value] : d.noise_std) {
    std::vector<std::string> cells = {escape_html(channel_name(channel)),
                                      noise_amount(d, channel, value),
                                      escape_html(noise_source(d, channel))};
    for (const auto& [changed, level] : d.noise_level) {
      if (changed == channel) cells.push_back(physics::number_text(level));
    }
    cells.resize(headings.size());
    table.row(cells);
  }
  out += table.html();
  if (std::any_of(d.noise.begin(), d.noise.end(),
                  [](const Noise& each) { return each.correlation_s > 0.0; })) {
    out += paragraph(
        "Chi-squared allows for slow noise: a residual that changes slowly may exceed the noise "
        "while chi-squared per sample is 1.");
  }
  return out;
}

// By stage, then by gain.
std::vector<const Trial*> sorted_trials(const Diagnosis& d) {
  std::vector<const Trial*> out;
  for (const Trial& trial : d.trials) out.push_back(&trial);
  std::stable_sort(out.begin(), out.end(), [](const Trial* a, const Trial* b) {
    return std::pair(a->stage, -a->gain.value) < std::pair(b->stage, -b->gain.value);
  });
  return out;
}

Section trial_section(const Diagnosis& d) {
  Section out("candidates", "Candidates");
  if (d.trials.empty()) return out;
  out += paragraph(
      "Every effect of the catalogue, and every formula of the user, that the model could lack is "
      "screened, the best candidates "
      "are fitted roughly, and the best of those fully. Among candidates of similar gain the "
      "simpler and the listed ones are preferred.");
  Table table(
      "Fully fitted candidates by their score gain on the selection windows, with its standard "
      "error, in the noise that was known at that stage. Significance: of the improvement, as a "
      "number of standard deviations.",
      {"candidate", "name", "added to", "gain [nat]", "significance"});
  for (const Trial* trial : sorted_trials(d)) {
    table.row({escape_html(trial_name(trial->id)), code(trial->id),
               trial->stage == 0
                   ? std::string("the declared model")
                   : std::to_string(trial->stage) + (trial->stage == 1 ? " finding" : " findings"),
               format_number(trial->gain.value) + " \u00b1 " + format_number(trial->gain.se, 2),
               format_number(trial->gain_z, 2) +
                   (trial->gain_z < significant_gain_z ? ", not significant" : "")});
  }
  out += table.html();
  return out;
}

std::string false_alarm_table(const FalseAlarms& alarms) {
  Table table("Synthetic recordings of the calibrated declared model.", {"quantity", "value"});
  table.row({"synthetic recordings", std::to_string(alarms.recordings)});
  table.row({"false alarms", std::to_string(alarms.alarms)});
  if (!alarms.chi2.empty()) {
    table.row({"chi-squared per sample, smallest", physics::number_text(alarms.chi2.front())});
    table.row({"chi-squared per sample, largest", physics::number_text(alarms.chi2.back())});
  }
  return table.html();
}

Section detection_section(const Diagnosis& d) {
  Section out("detection", "Detection limits");
  if (d.detection.limits.empty() && !d.false_alarms) return out;
  if (d.false_alarms) {
    out += paragraph(false_alarm_text(*d.false_alarms));
    out += false_alarm_table(*d.false_alarms);
  }
  out += paragraph("Smaller effects may be present but undetected" +
                   std::string(d.findings.empty() ? "" : ", in addition to the findings") +
                   ". Effects that replace a law instead of modifying it have no detection limit.");
  Table table("Detection limits (95 %).", {"effect", "parameter", "limit", "unit"});
  for (const DetectionLimit& limit : d.detection.limits) {
    const std::string unit =
        unit_text(limit.parameter().unit, limit.candidate.place, ResultUnits(d.model));
    table.row({escape_html(effect_name(limit.candidate)), code(limit.parameter().name),
               escape_html(plain_text(limit_text(limit))),
               escape_html(unit.empty() ? "none" : unit)});
  }
  out += table.html();
  if (!d.detection.inseparable.empty()) {
    Table pairs(
        "Effects that this recording cannot distinguish. Similarity: cosine of the angle between "
        "their effects on the readings.",
        {"effect", "effect", "similarity"});
    for (const InseparablePair& pair : d.detection.inseparable) {
      pairs.row({escape_html(effect_name(d.detection.limits[pair.one].candidate)),
                 escape_html(effect_name(d.detection.limits[pair.other].candidate)),
                 format_number(pair.cosine)});
    }
    out += pairs.html();
  }
  return out;
}

std::string integrity_table(const Integrity& integrity, const ResultUnits& units) {
  Table table(integrity.source + ": " + format_number(integrity.duration_s) +
                  units.after_number("s") + " at " + format_number(integrity.rate_hz, 4) +
                  units.after_number("Hz") + ", " + physics::counted(integrity.frames, "frame") +
                  ", " + std::to_string(integrity.lost) + " lost.",
              {"channel", "minimum", "maximum", "resolution", "saturated samples", "mains line"});
  for (const ChannelIntegrity& c : integrity.channels) {
    const auto amount = [&](double value) {
      return format_quantity(value, units.of(info(c.channel).unit));
    };
    table.row({escape_html(channel_name(c.channel)), amount(c.lowest), amount(c.highest),
               c.step > 0.0 ? amount(c.step) : "not visible",
               std::to_string(c.at_low_rail + c.at_high_rail),
               c.mains
                   ? amount(c.mains->amplitude) + " at " + format_number(c.mains->frequency_hz, 4) +
                         (units.dimensionless() ? "" : "\u00a0Hz")
                   : "none"});
  }
  std::string out = table.html();
  for (const std::string& remark : integrity.remarks) out += paragraph(plain_text(remark));
  return out;
}

Section recordings_section(const Diagnosis& d) {
  Section out("recordings", "Quality of the recordings");
  for (const Integrity& each : d.integrity) out += integrity_table(each, ResultUnits(d.model));
  return out;
}

}  // namespace

Section reproduction_section(const WindowCount& windows, double horizon_s, const ResultUnits& units,
                             const Provenance& provenance) {
  Section out("reproduce", "Reproduction");
  out += "<pre>" + escape_html(provenance.command) + "</pre>\n";
  std::string settings =
      "stickslip " + provenance.version + ", seed " + std::to_string(provenance.seed) + ", " +
      physics::counted(windows.fit, "window") + " to fit, " + std::to_string(windows.select) +
      " to select, " + std::to_string(windows.report) + " held out, " +
      format_seconds(horizon_s, units) + " each.";
  if (!provenance.built_with.empty()) settings += " Built with " + provenance.built_with + ".";
  out += paragraph(settings + " The same files, seed and version give the same numbers.");
  Table table("Input files (checksums as printed by sha256sum).", {"file", "SHA-256"});
  for (const auto& file : provenance.files) table.row({code(file.name), code(file.sha256)});
  if (const auto& file = provenance.candidates) table.row({code(file->name), code(file->sha256)});
  out += table.html();
  if (!provenance.augmented_model.empty()) {
    out += "<h3>Augmented model</h3>\n" +
           paragraph(
               "Calibrated, with a term for every finding; save it as a file to simulate or to "
               "diagnose with it.") +
           "<pre>" + escape_html(provenance.augmented_model) + "</pre>\n";
  }
  return out;
}

std::string html_page(const std::string& title, const std::string& first,
                      const std::vector<Section>& sections) {
  std::string out =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n"
      "<meta charset=\"utf-8\"/>\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>" +
      escape_html(title) + "</title>\n<style>" + std::string(report_style()) +
      "</style>\n</head>\n<body>\n<main>\n" + first;
  out += "<nav aria-label=\"Contents\"><ul>\n";
  for (const Section& section : sections) {
    if (!section.empty()) out += section.link();
  }
  out += "</ul></nav>\n";
  for (const Section& section : sections) {
    if (!section.empty()) out += section.html();
  }
  return out + "</main>\n</body>\n</html>\n";
}

namespace {

Section glossary_section() {
  Section out("glossary", "Terms");
  out += "<dl class=\"glossary\">\n";
  const auto define = [&](const char* term, const char* meaning) {
    out += "<dt>" + escape_html(term) + "</dt><dd>" + escape_html(meaning) + "</dd>\n";
  };
  define("Declared model",
         "The equations and parameters supplied for the rig. Parameters declared with a standard "
         "deviation are calibrated first.");
  define("Augmented model", "The declared model with a term for every finding.");
  define("Missing physics",
         "An effect that is present in the recording and absent from the model: a force, a "
         "friction law, a sensor error.");
  define("Held out",
         "Windows of the recording that nothing was fitted to and nothing was chosen by.");
  define("Residual", "Recording minus simulation.");
  define("Noise", "Random error of the sensors.");
  define("Chi-squared per sample",
         "Mean square of the residual over that of the noise: 1 for noise only, 4 for residuals of "
         "twice the noise.");
  define("95 % interval", "A range that contains the true value in 95 of 100 cases.");
  define("Probability",
         "Relative to the candidates that were fitted; effects outside the catalogue are not "
         "considered.");
  define("Phase space",
         "Velocity against displacement: every state of the mass is a point, a cycle of its "
         "motion is a closed curve.");
  out += "</dl>\n";
  return out;
}

}  // namespace

std::string report_html(const Diagnosis& diagnosis, const Provenance& provenance) {
  const std::vector<Section> sections = {
      findings_section(diagnosis),
      campaign_section(diagnosis),
      stretch_section(diagnosis),
      residual_section(diagnosis),
      fit_section(diagnosis),
      calibration_section(diagnosis),
      noise_section(diagnosis),
      trial_section(diagnosis),
      detection_section(diagnosis),
      recordings_section(diagnosis),
      reproduction_section(diagnosis.windows, diagnosis.horizon_s, ResultUnits(diagnosis.model),
                           provenance),
      glossary_section()};
  return html_page("Diagnosis: " + headline_of(diagnosis), first_screen(diagnosis, provenance),
                   sections);
}

}  // namespace stickslip::report
