#include "diagnosis/report/html.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "diagnosis/report/picture.h"
#include "diagnosis/report/pictures.h"
#include "diagnosis/report/report.h"
#include "diagnosis/report/style.h"
#include "diagnosis/report/words.h"

namespace stickslip::diagnosis {

namespace {

std::string paragraph(const std::string& text, const char* style = "") {
  return std::string("<p") + (*style != 0 ? std::string(" class=\"") + style + "\"" : "") + ">" +
         html_text(text) + "</p>\n";
}

std::string code(std::string_view text) {
  return "<code>" + html_text(std::string(text)) + "</code>";
}

// A table; what goes into cells is HTML, what goes into captions and headings is text.
class Table {
 public:
  Table(const std::string& caption, const std::vector<std::string>& headings) {
    html_ = "<table>\n<caption>" + html_text(caption) + "</caption>\n<thead><tr>";
    for (const std::string& each : headings) {
      html_ += "<th scope=\"col\">" + html_text(each) + "</th>";
    }
    html_ += "</tr></thead>\n<tbody>\n";
  }
  // The first cell names the row.
  void row(const std::vector<std::string>& cells) {
    ++rows_;
    html_ += "<tr>";
    for (std::size_t i = 0; i < cells.size(); ++i) {
      html_ += i == 0 ? "<th scope=\"row\">" + cells[i] + "</th>" : "<td>" + cells[i] + "</td>";
    }
    html_ += "</tr>\n";
  }
  // A short table stays on one sheet of paper.
  std::string html() const {
    const std::string style = rows_ <= most_together ? "scroll together" : "scroll";
    return "<div class=\"" + style + "\">" + html_ + "</tbody>\n</table></div>\n";
  }

 private:
  static constexpr int most_together = 16;
  std::string html_;
  int rows_ = 0;
};

std::string text_cell(const std::string& text) { return html_text(text); }

// A bar of that share of the cell.
std::string bar(double share, const char* style = "") {
  char width[32];
  std::snprintf(width, sizeof width, "%.1f", 100.0 * std::clamp(share, 0.0, 1.0));
  return std::string("<i") + (*style != 0 ? std::string(" class=\"") + style + "\"" : "") +
         " style=\"width:" + width + "%\"></i>";
}

class Section {
 public:
  Section(const char* id, const char* heading) : id_(id), heading_(heading) {}
  Section& operator+=(const std::string& html) {
    html_ += html;
    return *this;
  }
  bool empty() const { return html_.empty(); }
  std::string link() const {
    return "<li><a href=\"#" + id_ + "\">" + html_text(heading_) + "</a></li>\n";
  }
  std::string html() const {
    return "<section id=\"" + id_ + "\">\n<h2>" + html_text(heading_) + "</h2>\n" + html_ +
           "</section>\n";
  }

 private:
  std::string id_;
  std::string heading_;
  std::string html_;
};

// ---- The first screen

std::string answer(const std::string& question, const std::string& html) {
  return "<div><dt>" + html_text(question) + "</dt><dd>" + html + "</dd></div>\n";
}

const physics::ParameterCard* card_of(const Finding& finding, const Estimate& estimate) {
  for (const physics::ParameterCard& card : finding.effect->card().parameters) {
    if (card.name == estimate.name) return &card;
  }
  return nullptr;
}

std::string what_answer(const Diagnosis& d) {
  if (d.findings.empty()) {
    return html_text(d.verdict == Verdict::consistent
                         ? "Nothing. No effect of the catalogue predicts the recording better than "
                           "the model does without it."
                         : "Not known. No effect of the catalogue explains the difference.");
  }
  std::string out;
  for (const Finding& finding : d.findings) {
    out += "<p>" + html_text(plain_words(finding.statement));
    if (!finding.parameters.empty()) {
      const Estimate& first = finding.parameters.front();
      const EstimateWords words = estimate_words(first.value, first.low, first.high);
      const physics::ParameterCard* card = card_of(finding, first);
      const std::string unit = card != nullptr ? unit_words(card->unit, finding.place) : "";
      out += " In numbers: " + code(first.name) + " = <span class=\"number\">" + words.value +
             "</span>" + html_text(unit.empty() ? unit : "\u00a0" + unit) +
             " (95\u00a0%: " + words.low + " to " + words.high + ").";
    }
    out += "</p>";
  }
  return out;
}

std::string where_answer(const Diagnosis& d) {
  if (!d.location) {
    return html_text(
        "Nowhere: in every channel, at all times, at all speeds and deflections what "
        "is left is the noise.");
  }
  std::string out = html_text(plain_words(d.location->statement));
  for (const Region& worst : d.location->regions) {
    if (d.location->channel && worst.channel != *d.location->channel) continue;
    out += html_text(" Most conspicuous: " + channel_words(worst.channel) + " " + worst.words +
                     ", " + number_words(std::sqrt(worst.energy)) + " times the noise (elsewhere " +
                     number_words(std::sqrt(worst.energy_outside)) + ").");
    break;
  }
  return out;
}

// The gain of a finding in standard errors, if it was tried alone.
const Trial* trial_of(const Diagnosis& d, const Finding& finding) {
  const std::string name = Suspect{finding.effect, finding.place}.name();
  for (const Trial& trial : d.trials) {
    if (trial.id == name) return &trial;
  }
  return nullptr;
}

std::string windows_words(const Diagnosis& d) {
  return std::to_string(d.heldout_windows) + " stretches of " + seconds_words(d.horizon_s) +
         " to which no parameter was fitted";
}

std::string sure_of_findings(const Diagnosis& d) {
  std::string out;
  for (const Finding& finding : d.findings) {
    const std::string name = suspect_words({finding.effect, finding.place});
    out += "<p><b>" + percent_words(finding.probability) + "</b> " +
           html_text((d.findings.size() > 1 ? "for " + name + ", " : std::string()) +
                     "among the explanations that were tried.");
    if (!finding.alternatives.empty()) {
      const Alternative& next = finding.alternatives.front();
      out += html_text(" Next: " + suspect_words(next.suspect) + ", ") +
             percent_words(next.probability) + ".";
    }
    const Trial* trial = trial_of(d, finding);
    if (trial != nullptr && trial->stage == 0 && trial->gain_z > 0.0) {
      out += html_text(" It predicts better by " + number_words(trial->gain_z, 2) +
                       " standard errors, over " + windows_words(d) + ".");
    }
    out += "</p>";
  }
  return out;
}

std::string sure_answer(const Diagnosis& d) {
  if (!d.findings.empty()) return sure_of_findings(d);
  if (d.verdict == Verdict::unexplained) {
    return html_text("That there is a difference is sure: over " + windows_words(d) +
                     " the model misses by more than the noise can.");
  }
  std::string out = html_text("The model was held against " + windows_words(d) + ". ");
  if (d.false_alarms) out += html_text(sentence_of(*d.false_alarms) + " ");
  if (!d.detection.limits.empty()) {
    out += html_text(std::to_string(d.detection.limits.size()) +
                     " effects were looked for whose size a number tells.");
  }
  return out;
}

std::string fit_answer(const Diagnosis& d) {
  std::string out = "<b>" + number_words(d.baseline.chi2_per_sample);
  if (d.augmented) out += " \u2192 " + number_words(d.augmented->chi2_per_sample);
  out +=
      "</b> " + html_text(d.augmented
                              ? "chi-squared per sample, before and with what was found: 1 is what "
                                "noise alone leaves."
                              : "chi-squared per sample: 1 is what noise alone leaves.");
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (!d.baseline.rmse[c]) continue;
    const ChannelInfo& channel = channel_table[c];
    out += html_text(" Predictions of the " + channel_words(all_channels[c]) + " are off by ") +
           quantity_words(*d.baseline.rmse[c], channel.unit);
    if (d.augmented && d.augmented->rmse[c]) {
      out += " before, " +
             quantity_words(*d.augmented->rmse[c], channel.unit, *d.baseline.rmse[c]) + " with it";
    }
    out += html_text(", up to " + seconds_words(d.horizon_s) + " ahead");
    for (const auto& [measured, noise] : d.noise_std) {
      if (measured == all_channels[c])
        out += "; its noise is " + quantity_words(noise, channel.unit, *d.baseline.rmse[c]);
    }
    out += ".";
    break;  // the first channel stands for the others here; all of them follow below
  }
  return out;
}

// The smallest sizes of physics that the contract lists, as far as a first screen has room; all of
// them follow below.
std::string unseen_answer(const Diagnosis& d) {
  constexpr std::size_t most = 5;
  std::vector<std::string> limits;
  for (const DetectionLimit& limit : d.detection.limits) {
    const physics::Card& card = limit.suspect.effect->card();
    if (!card.depends_on.empty() || limit.suspect.place.channel || limits.size() == most) continue;
    const std::string unit = unit_words(limit.parameter().unit, limit.suspect.place);
    limits.push_back(html_text(suspect_words(limit.suspect)) + " (" + code(limit.parameter().name) +
                     " = " + html_text(plain_words(value_text(limit))) +
                     html_text(unit.empty() ? unit : "\u00a0" + unit) + ")");
  }
  if (limits.empty()) return "";
  std::string out = "From these sizes on: ";
  for (std::size_t i = 0; i < limits.size(); ++i) out += (i > 0 ? ", " : "") + limits[i];
  return out + "; the others stand under <a href=\"#unseen\">what else would have been seen</a>.";
}

std::string next_answer(const Diagnosis& d) {
  switch (answer_of(d)) {
    case Answer::ambiguous:
      for (const Finding& finding : d.findings) {
        if (finding.separating_experiment) {
          return html_text("This run would tell them apart: " +
                           plain_words(*finding.separating_experiment) + ".");
        }
      }
      return html_text("Record more, or under other drives: these data do not tell them apart.");
    case Answer::unexplained:
      return html_text(
          "Look at the pictures below for when and where it fails, check the recording "
          "itself (its rails, losses and mains are listed), and check numbers that the "
          "model gives as exactly known.");
    case Answer::consistent:
    case Answer::named:
      break;
  }
  return "";
}

const char* kicker_of(Answer kind) {
  switch (kind) {
    case Answer::consistent:
      return "Verdict: consistent";
    case Answer::named:
      return "Verdict: missing physics, named";
    case Answer::ambiguous:
      return "Verdict: missing physics, two explanations are left";
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
    case Answer::ambiguous:
      return "ambiguous";
    case Answer::unexplained:
      break;
  }
  return "unexplained";
}

// What was compared with what, for somebody who was handed the page.
std::string subject_of(const Diagnosis& d, const Provenance& provenance) {
  std::string out = "<p class=\"soft\">" + html_text("Compared: ");
  for (std::size_t i = 0; i < provenance.files.size(); ++i) {
    const bool model = i + 1 == provenance.files.size();
    if (i > 0) out += model ? html_text(" with the model ") : ", ";
    out += code(provenance.files[i].name);
  }
  double seconds = 0.0;
  for (const Integrity& each : d.integrity) seconds += each.duration_s;
  if (seconds > 0.0) out += html_text(", " + number_words(seconds) + " s of recording");
  return out +
         html_text(". The rig, with the numbers that fit the recording: " + rig_words(d.model)) +
         "</p>\n";
}

std::string first_screen(const Diagnosis& d, const Provenance& provenance) {
  const Answer kind = answer_of(d);
  std::string out = "<header class=\"" + std::string(style_of(kind)) +
                    "\">\n<div class=\"verdict\">\n<p class=\"kicker\">" + kicker_of(kind) +
                    "</p>\n<h1>" + html_text(headline_of(d)) + "</h1>\n</div>\n" +
                    subject_of(d, provenance) + "<dl class=\"answers\">\n";
  out += answer("What was left out", what_answer(d));
  out += answer("Where it shows", where_answer(d));
  out += answer("How sure", sure_answer(d));
  out += answer("The fit on data that nothing was fitted to", fit_answer(d));
  const std::string unseen = kind == Answer::consistent ? unseen_answer(d) : "";
  if (!unseen.empty()) out += answer("What would have been seen", unseen);
  const std::string next = next_answer(d);
  if (!next.empty()) out += answer("What to do next", next);
  return out + "</dl>\n</header>\n";
}

// ---- What was left out

std::string parameter_table(const Finding& finding) {
  Table table("Its numbers, with 95 % intervals.",
              {"what", "name", "value", "95 % interval", "unit"});
  for (const Estimate& each : finding.parameters) {
    const EstimateWords words = estimate_words(each.value, each.low, each.high);
    const physics::ParameterCard* card = card_of(finding, each);
    const std::string unit = card != nullptr ? unit_words(card->unit, finding.place) : "";
    table.row({card != nullptr ? text_cell(std::string(card->meaning)) : "", code(each.name),
               words.value, words.low + " to " + words.high,
               text_cell(unit.empty() ? "none" : unit)});
  }
  return table.html();
}

std::string alternative_table(const Finding& finding) {
  Table table(
      "What it could have been instead: the candidates that explained most, and how "
      "probable each is among them. Candidates under 0.5 % are not listed.",
      {"candidate", "name", "probability", ""});
  const auto row = [&](const Suspect& suspect, double probability) {
    table.row({text_cell(suspect_words(suspect)), code(suspect.name()), percent_words(probability),
               "<div class=\"bar\">" + bar(probability) + "</div>"});
  };
  row({finding.effect, finding.place}, finding.probability);
  for (const Alternative& each : finding.alternatives) row(each.suspect, each.probability);
  return table.html();
}

Section findings_section(const Diagnosis& d) {
  Section out("findings", "What was left out");
  int number = 0;
  for (const Finding& finding : d.findings) {
    const physics::Card& card = finding.effect->card();
    out += "<h3>" + std::to_string(++number) + ". " +
           html_text(suspect_words({finding.effect, finding.place})) + "</h3>\n" +
           paragraph(plain_words(finding.statement));
    out += paragraph(std::string(card.sentence), "soft");
    out += "<p>As a formula: " + code(card.equation) + "</p>\n";
    if (finding.when_s) {
      out += paragraph("It lasts from " + number_words(finding.when_s->first) + " to " +
                       number_words(finding.when_s->second) + " s.");
    }
    out += paragraph("Held-out chi-squared per sample: " + number_words(finding.chi2_before) +
                     " without it, " + number_words(finding.chi2_after) + " with it.");
    out += parameter_table(finding);
    out += shape_figures(finding);
    out += alternative_table(finding);
    if (finding.separating_experiment) {
      out += "<p><b>The run that would tell them apart:</b> " +
             html_text(plain_words(*finding.separating_experiment)) + ".</p>\n";
    } else if (!card.experiment.empty()) {
      out += paragraph("To see it by itself: " + std::string(card.experiment) + ".", "soft");
    }
  }
  return out;
}

// ---- Pictures

std::string base_words(const Evidence& evidence) {
  return evidence.base_doubted
             ? " What the noise of the base's own channel can explain is taken out."
             : "";
}

Section stretch_section(const Diagnosis& d) {
  Section out("recorded", "Recorded and simulated");
  const std::string figures = stretch_figures(d);
  if (figures.empty()) return out;
  const Evidence& evidence = *d.evidence;
  const Stretch& stretch = evidence.stretch;
  const double from_s = evidence.windows[stretch.first].begin_s;
  const double to_s = evidence.windows[stretch.first + stretch.count - 1].end_s;
  out += paragraph("Shown: " + number_words(from_s, 4) + " to " + number_words(to_s, 4) +
                   " s. Chosen by this rule: of the stretches to which no parameter was fitted, "
                   "the one in which "
                   "the declared model misses most. There its residuals have a mean square of " +
                   number_words(stretch.before) +
                   " times the noise; in the typical such window it is " +
                   number_words(stretch.typical) +
                   ". Dotted lines: a simulation starts anew, from a state that is fitted to that "
                   "window alone." +
                   base_words(evidence));
  out += figures;
  return out;
}

std::string region_table(const Diagnosis& d) {
  if (!d.location || d.location->regions.empty()) return "";
  constexpr std::size_t most = 12;
  const auto& regions = d.location->regions;
  Table table(
      "Conditions under which the declared model misses more than elsewhere: residuals over the "
      "noise, root mean square. Of the entries of such lists one in twenty at most is there by "
      "chance (Benjamini and Yekutieli's rule, over blocks of windows drawn anew).",
      {"channel", "condition", "there", "elsewhere"});
  for (std::size_t i = 0; i < std::min(most, regions.size()); ++i) {
    table.row({text_cell(channel_words(regions[i].channel)), text_cell(regions[i].words),
               number_words(std::sqrt(regions[i].energy)),
               number_words(std::sqrt(regions[i].energy_outside))});
  }
  return table.html();
}

Section residual_section(const Diagnosis& d) {
  Section out("where", d.verdict == Verdict::consistent ? "What is left over"
                                                        : "Where it fails, and what is left over");
  const std::string figures = residual_figures(d);
  if (!figures.empty()) {
    out += paragraph(
        "Residual: what is left when a simulation is taken from the recording, divided by the "
        "noise "
        "of the channel; 1 is noise alone. All stretches of the recording are in these pictures, "
        "fitted and held out." +
        base_words(*d.evidence));
    out += figures;
  }
  out += region_table(d);
  return out;
}

// ---- Numbers

Section fit_section(const Diagnosis& d) {
  Section out("fit", "The fit on data that nothing was fitted to");
  const bool changed = d.augmented.has_value();
  std::vector<std::string> headings = {"quantity", "declared model"};
  if (changed) headings.insert(headings.end(), {"with what was found", "remaining", ""});
  Table table("Errors of predictions up to " + seconds_words(d.horizon_s) +
                  " ahead (root mean square), over " + std::to_string(d.heldout_windows) +
                  " held-out windows; " + std::to_string(d.fitted_windows) +
                  " others were fitted. Bars: the declared model above, with what was found below.",
              headings);
  const auto row = [&](const std::string& name, double before, std::optional<double> after,
                       std::string_view unit) {
    std::vector<std::string> cells = {text_cell(name), quantity_words(before, unit)};
    if (changed && after) {
      const double most = std::max({before, *after, 1.0e-300});
      cells.push_back(quantity_words(*after, unit, before));
      cells.push_back(number_words(100.0 * *after / std::max(before, 1.0e-300)) + "\u00a0%");
      cells.push_back("<div class=\"bar\">" + bar(before / most, "was") + bar(*after / most) +
                      "</div>");
    }
    table.row(cells);
  };
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (!d.baseline.rmse[c]) continue;
    row(channel_words(all_channels[c]), *d.baseline.rmse[c],
        changed ? d.augmented->rmse[c] : std::nullopt, channel_table[c].unit);
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
      "What the model gives with a doubt is adjusted within that doubt before anything is called "
      "missing. A parameter that is only off within its doubt is not missing physics.");
  Table table("Calibrated parameters with 95 % intervals; units stand at the end of the names.",
              {"parameter", "declared", "calibrated", "95 % interval", "shift in declared sigmas"});
  for (const Calibration& each : d.calibrated) {
    char shift[32];
    std::snprintf(shift, sizeof shift, "%.1f", std::abs(each.sigmas_off));
    const EstimateWords words = estimate_words(each.value, each.low, each.high);
    const bool known = each.high > each.low;
    table.row({code(each.path),
               each.sigma > 0.0
                   ? number_words(each.declared, 4) + " \u00b1 " + number_words(each.sigma, 2)
                   : std::string(),
               words.value, known ? words.low + " to " + words.high : "not known",
               (each.sigmas_off < 0.0 ? "\u2212" : "+") + std::string(shift)});
  }
  out += table.html();
  out += calibration_figure(d);
  return out;
}

Section noise_section(const Diagnosis& d) {
  Section out("noise", "Noise floor");
  if (d.noise_std.empty()) return out;
  Table table("The noise of each channel, as a standard deviation: what no model can explain.",
              {"channel", "noise", "where it comes from"});
  for (const auto& [channel, value] : d.noise_std) {
    const bool estimated = std::find(d.noise_estimated.begin(), d.noise_estimated.end(), channel) !=
                           d.noise_estimated.end();
    table.row({text_cell(channel_words(channel)), quantity_words(value, info(channel).unit),
               estimated ? "estimated from the recording" : "declared by the model"});
  }
  out += table.html();
  return out;
}

// In the order of their stages, the best of each first.
std::vector<const Trial*> sorted_trials(const Diagnosis& d) {
  std::vector<const Trial*> out;
  for (const Trial& trial : d.trials) out.push_back(&trial);
  std::stable_sort(out.begin(), out.end(), [](const Trial* a, const Trial* b) {
    return std::pair(a->stage, a->heldout_chi2) < std::pair(b->stage, b->heldout_chi2);
  });
  return out;
}

Section trial_section(const Diagnosis& d) {
  Section out("tried", "What was tried");
  if (d.trials.empty()) return out;
  out += paragraph(
      "Every effect of the catalogue that the model could lack is looked at in one step, the best "
      "are fitted roughly, and these to their end. A small difference in chi-squared does not "
      "decide by itself: the simpler explanation, and one that has a name, is preferred as long as "
      "it explains nearly as much.");
  Table table(
      "What was fitted to its end, by what it leaves on held-out data (1: noise alone). Gain: "
      "how much better it predicts than without it, in standard errors over windows.",
      {"candidate", "name", "added to", "held-out chi-squared", "gain"});
  for (const Trial* trial : sorted_trials(d)) {
    table.row({text_cell(trial_words(trial->id)), code(trial->id),
               trial->stage == 0 ? std::string("the declared model")
                                 : std::to_string(trial->stage) + " found before",
               number_words(trial->heldout_chi2), number_words(trial->gain_z, 2)});
  }
  out += table.html();
  return out;
}

Section unseen_section(const Diagnosis& d) {
  Section out("unseen", "What else would have been seen");
  if (d.detection.limits.empty() && !d.false_alarms) return out;
  if (d.false_alarms) out += paragraph(sentence_of(*d.false_alarms));
  out += paragraph(
      "What is not found may still be there, only smaller. From these sizes on the recording would "
      "have shown it" +
      std::string(d.findings.empty() ? "" : ", beside what was found") +
      ". Effects that replace a law instead of bending it are "
      "not in this table.");
  Table table("From which size on each effect would have been named.",
              {"effect", "by this number", "from", "unit"});
  for (const DetectionLimit& limit : d.detection.limits) {
    const std::string unit = unit_words(limit.parameter().unit, limit.suspect.place);
    table.row({text_cell(suspect_words(limit.suspect)), code(limit.parameter().name),
               text_cell(plain_words(value_text(limit))), text_cell(unit.empty() ? "none" : unit)});
  }
  out += table.html();
  if (!d.detection.lookalikes.empty()) {
    Table pairs(
        "These move the readings alike: this recording cannot tell one from the other. "
        "Likeness: 1 is the same.",
        {"one", "other", "likeness"});
    for (const Lookalikes& pair : d.detection.lookalikes) {
      pairs.row({text_cell(suspect_words(d.detection.limits[pair.one].suspect)),
                 text_cell(suspect_words(d.detection.limits[pair.other].suspect)),
                 number_words(pair.cosine)});
    }
    out += pairs.html();
  }
  return out;
}

std::string integrity_table(const Integrity& integrity) {
  Table table(
      integrity.source + ": " + number_words(integrity.duration_s) + " s at " +
          number_words(integrity.rate_hz, 4) + " Hz, " + std::to_string(integrity.frames) +
          " frames, " + std::to_string(integrity.lost) + " lost.",
      {"channel", "lowest", "highest", "smallest step", "samples at a rail", "line of the mains"});
  for (const ChannelIntegrity& c : integrity.channels) {
    const auto amount = [&c](double value) { return quantity_words(value, info(c.channel).unit); };
    table.row({text_cell(channel_words(c.channel)), amount(c.lowest), amount(c.highest),
               c.step > 0.0 ? amount(c.step) : "none seen",
               std::to_string(c.at_low_rail + c.at_high_rail),
               c.mains ? amount(c.mains->amplitude) + " at " +
                             number_words(c.mains->frequency_hz, 4) + "\u00a0Hz"
                       : "none"});
  }
  std::string out = table.html();
  for (const std::string& remark : integrity.remarks) out += paragraph(plain_words(remark));
  return out;
}

Section recordings_section(const Diagnosis& d) {
  Section out("recordings", "The recordings themselves");
  for (const Integrity& each : d.integrity) out += integrity_table(each);
  return out;
}

Section repeat_section(const Diagnosis& d, const Provenance& provenance) {
  Section out("repeat", "To repeat this");
  out += "<pre>" + html_text(provenance.command) + "</pre>\n";
  std::string made = "stickslip " + provenance.version + ", seed " +
                     std::to_string(provenance.seed) + ", " + std::to_string(d.fitted_windows) +
                     " windows fitted, " + std::to_string(d.heldout_windows) + " held out, " +
                     seconds_words(d.horizon_s) + " each.";
  if (!provenance.built_with.empty()) made += " Built with " + provenance.built_with + ".";
  out += paragraph(made + " The same files, seed and version give the same numbers.");
  Table table("What went in, by its SHA-256 (sha256sum FILE prints it).", {"file", "SHA-256"});
  for (const auto& file : provenance.files) table.row({code(file.name), code(file.sha256)});
  out += table.html();
  if (!provenance.mended_model.empty()) {
    out += "<h3>The model that comes out</h3>\n" +
           paragraph(
               "Calibrated, with a term for all that was found; save it as a file to simulate "
               "or to diagnose with it.") +
           "<pre>" + html_text(provenance.mended_model) + "</pre>\n";
  }
  return out;
}

Section words_section() {
  Section out("words", "Words that are used here");
  out += "<dl class=\"words\">\n";
  const auto word = [&](const char* name, const char* meaning) {
    out += "<dt>" + html_text(name) + "</dt><dd>" + html_text(meaning) + "</dd>\n";
  };
  word("Declared model",
       "The physics that the owner of the rig believes in, as equations with numbers; some of them "
       "with a doubt, within which they are calibrated first.");
  word("Missing physics",
       "An effect that is in the recording and not in the model: a force, a law of friction, a "
       "property of an instrument.");
  word("Held out",
       "Stretches of the recording to which no parameter was fitted. What predicts them better has "
       "learnt something about the rig, not about its noise.");
  word("Residual", "What is left when the simulation is taken from the recording.");
  word("Noise", "What the instruments add at random; no model can explain it.");
  word("Chi-squared per sample",
       "The mean square of the residual over that of the noise: 1 if only noise is left, 4 if "
       "residuals are twice as large as the noise.");
  word("95 % interval", "A range that holds the true value in 95 of 100 such cases.");
  word("Probability",
       "How probable an explanation is among those that were tried; something that nobody thought "
       "of is not among them.");
  word("Phase space",
       "Displacement to the right, velocity upwards: every state of the mass is a "
       "point, a cycle of its motion goes around.");
  out += "</dl>\n";
  return out;
}

}  // namespace

std::string report_html(const Diagnosis& diagnosis, const Provenance& provenance) {
  const std::vector<Section> sections = {findings_section(diagnosis),
                                         stretch_section(diagnosis),
                                         residual_section(diagnosis),
                                         fit_section(diagnosis),
                                         calibration_section(diagnosis),
                                         noise_section(diagnosis),
                                         trial_section(diagnosis),
                                         unseen_section(diagnosis),
                                         recordings_section(diagnosis),
                                         repeat_section(diagnosis, provenance),
                                         words_section()};
  std::string out =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n"
      "<meta charset=\"utf-8\"/>\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<title>" +
      html_text("Diagnosis: " + headline_of(diagnosis)) + "</title>\n<style>" +
      std::string(report_style()) + "</style>\n</head>\n<body>\n<main>\n";
  out += first_screen(diagnosis, provenance);
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

}  // namespace stickslip::diagnosis
