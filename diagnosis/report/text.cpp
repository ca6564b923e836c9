// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/report/text.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>
#include <vector>

#include "diagnosis/report/campaign.h"
#include "diagnosis/report/formatting.h"
#include "diagnosis/report/headline.h"
#include "physics/number_text.h"
#include "physics/result_units.h"

namespace stickslip::report {

using namespace diagnosis;
using physics::ResultUnits;

namespace {

using physics::number_text;
using physics::percent_text;

void add_verdict(std::ostringstream& text, const Diagnosis& d) {
  switch (d.verdict) {
    case Verdict::consistent:
      text << "CONSISTENT: the model explains the recording to within the noise."
           << noise_level_text(d) << "\n";
      break;
    case Verdict::missing_physics:
      text << "MISSING PHYSICS: the model lacks " << physics::counted(d.findings.size(), "effect")
           << "."
           << (answer_of(d) == Answer::partial ? " Most of the mismatch is explained, not all."
                                               : "")
           << "\n";
      break;
    case Verdict::unexplained:
      text << "UNEXPLAINED: the model does not fit the recording, and no candidate effect explains "
           << (d.findings.empty() ? "the mismatch" : "all of the mismatch") << ".\n";
      break;
  }
}

// One line for the first region of each aspect.
std::vector<std::string> conditions_of(const Location& location) {
  std::vector<std::string> out;
  std::vector<Aspect> listed;
  for (const Region& region : location.regions) {
    if (std::find(listed.begin(), listed.end(), region.aspect) != listed.end()) continue;
    listed.push_back(region.aspect);
    out.push_back(std::string(info(region.channel).stem)
                      .append(" deviates more ")
                      .append(region.words)
                      .append(" (")
                      .append(number_text(std::sqrt(region.energy)))
                      .append(" times the noise, elsewhere ")
                      .append(number_text(std::sqrt(region.energy_outside)))
                      .append(")"));
  }
  return out;
}

void add_location(std::ostringstream& text, const Location& location) {
  text << "  Where: " << location.statement << "\n";
  for (const std::string& line : conditions_of(location)) text << "         " << line << "\n";
}

std::string range_text(const Estimate& estimate) {
  if (is_undetermined(estimate)) return "not determined";
  return distinct_text(estimate.low, estimate.value) + " to " +
         distinct_text(estimate.high, estimate.value);
}

std::string formula_text(const Estimate& estimate) {
  const bool undetermined = is_undetermined(estimate);
  if (undetermined || !(estimate.formula_uncertainty > 0.0)) return "";
  return "; formula error " + number_text(estimate.formula_uncertainty) + ", 1 SD";
}

// The effects that score better than the finding, and why they are not it.
void add_preference(std::ostringstream& text, const Finding& finding) {
  if (finding.preferred_over.empty()) return;
  text << "       preferred, as the simpler or the listed one, to ";
  const char* separator = "";
  for (const CandidateEffect& each : finding.preferred_over) {
    text << std::exchange(separator, ", ") << id_of(each);
  }
  text << (finding.preferred_over.size() > 1 ? ", which score better\n"
                                             : ", which scores better\n");
}

void add_finding(std::ostringstream& text, const Finding& finding, int number) {
  text << "  " << number << ". " << id_of(finding) << ": " << finding.statement << "\n";
  for (const Estimate& estimate : finding.parameters) {
    text << "       " << estimate.name << " = " << number_text(estimate.value)
         << "  (95 %: " << range_text(estimate) << formula_text(estimate) << ")\n";
  }
  text << "       score gain " << number_text(finding.gain.value) << " +/- "
       << number_text(finding.gain.se) << " nat, chi-squared per sample "
       << number_text(finding.chi2_before) << " -> " << number_text(finding.chi2_after)
       << " on the selection windows; probability among the candidates "
       << percent_text(finding.probability) << "\n";
  add_preference(text, finding);
  for (const Alternative& each : finding.alternatives) {
    text << "       alternative: " << id_of(each.candidate) << " ("
         << percent_text(each.probability) << ")\n";
  }
  if (finding.separating_experiment) {
    text << "       To discriminate: " << *finding.separating_experiment << "\n";
  }
}

void add_fit(std::ostringstream& text, const Diagnosis& d) {
  text << "  Held-out fit: RMS prediction error up to " << number_text(d.horizon_s)
       << ResultUnits(d.model).after_number("s") << " ahead\n";
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (!d.baseline.rmse[c]) continue;
    const ChannelInfo& channel = channel_table[c];
    const std::string unit = ResultUnits(d.model).after_number(channel.unit);
    text << "    " << channel.stem << ": " << number_text(*d.baseline.rmse[c]) << unit;
    if (d.augmented && d.augmented->rmse[c]) {
      text << " -> " << number_text(*d.augmented->rmse[c]) << unit;
    }
    text << "\n";
  }
  text << "  Held-out chi-squared per sample: " << number_text(d.baseline.chi2_per_sample);
  if (d.augmented) text << " -> " << number_text(d.augmented->chi2_per_sample);
  text << "  (1: noise only; " << physics::counted(d.windows.fit, "window") << " to fit, "
       << d.windows.select << " for selection, " << d.windows.report << " held out throughout)\n";
  if (d.verdict != Verdict::consistent && !d.noise_level.empty()) {
    text << " " << noise_level_text(d) << "\n";
  }
  if (const std::string remark = fit_remark(d); !remark.empty()) text << " " << remark << "\n";
  if (d.noise_estimated.empty()) return;
  text << "  Noise estimated from the recording, not declared:";
  const char* before = " ";
  for (const Channel channel : d.noise_estimated) {
    text << before << info(channel).stem;
    before = ", ";
  }
  text << "\n";
}

void add_calibration(std::ostringstream& text, const Diagnosis& d) {
  if (d.calibrated.empty()) return;
  text << "  Calibrated (shift in declared standard deviations):";
  bool far = false;
  const char* before = " ";
  for (const Calibration& each : d.calibrated) {
    text << before << each.path << " = " << number_text(each.value) << " ("
         << shift_text(each.shift_sigmas) << ")";
    before = "; ";
    far = far || std::abs(each.shift_sigmas) > 3.0;
  }
  text << "\n";
  if (!far) return;
  text << "  Above 3 standard deviations: the declared standard deviation is too small, or the "
          "parameter compensates for missing physics.\n";
}

void add_recordings(std::ostringstream& text, const Diagnosis& d) {
  const ResultUnits units(d.model);
  for (const Integrity& each : d.integrity) {
    text << "  Recording " << each.source << ": " << number_text(each.duration_s)
         << units.after_number("s") << " at " << number_text(each.rate_hz)
         << units.after_number("Hz");
    if (each.remarks.empty()) text << "; complete, no channel saturated, no mains line";
    text << "\n";
    for (const std::string& remark : each.remarks) text << "    " << remark << "\n";
  }
}

// Limited to the listed physics of the rig: sensor errors at every channel fill a page, and the
// other formats have them.
void add_detection_limits(std::ostringstream& text, const Detection& detection) {
  const auto is_listed = [](const CandidateEffect& candidate) {
    return candidate.effect->card().depends_on.empty() && !candidate.place.channel;
  };
  const char* before = "  Detection limits (95 %): ";
  for (const DetectionLimit& limit : detection.limits) {
    if (!is_listed(limit.candidate)) continue;
    text << before << limit.candidate.name() << " (" << limit.parameter().name << " = "
         << limit_text(limit) << ")";
    before = ", ";
  }
  if (before[0] == ',') text << "\n";
  before = "  Not distinguishable: ";
  for (const InseparablePair& pair : detection.inseparable) {
    const CandidateEffect& one = detection.limits[pair.one].candidate;
    const CandidateEffect& other = detection.limits[pair.other].candidate;
    if (!is_listed(one) || !is_listed(other)) continue;
    text << before << one.name() << " and " << other.name();
    before = "; ";
  }
  if (before[0] == ';') text << "\n";
}

void add_trials(std::ostringstream& text, const Diagnosis& d) {
  text << "  Candidates fitted (score gain in nat on the selection windows):";
  int stage = 0;
  const char* before = " ";
  for (const Trial& trial : d.trials) {
    if (trial.stage != stage) {
      stage = trial.stage;
      before = " | then ";
    }
    text << before << trial.id << " (" << number_text(trial.gain.value) << ")";
    before = ", ";
  }
  text << "\n";
}

}  // namespace

std::string limit_text(const DetectionLimit& limit) {
  return distinct_text(limit.value, limit.parameter().neutral);
}

std::string false_alarm_text(const FalseAlarms& alarms) {
  std::string out = "Of " + physics::counted(alarms.recordings, "synthetic recording") +
                    " of the calibrated declared model, with nothing "
                    "missing, " +
                    std::to_string(alarms.alarms) + " raised a false alarm";
  if (!alarms.chi2.empty()) {
    out += "; noise alone gave a chi-squared of " + number_text(alarms.chi2.front()) + " to " +
           number_text(alarms.chi2.back()) + " per sample";
  }
  return out + ".";
}

std::string report_text(const Diagnosis& diagnosis) {
  std::ostringstream text;
  add_verdict(text, diagnosis);
  if (diagnosis.location) add_location(text, *diagnosis.location);
  int number = 0;
  for (const Finding& finding : diagnosis.findings) add_finding(text, finding, ++number);
  if (diagnosis.campaign) text << campaign_text(diagnosis);
  add_fit(text, diagnosis);
  add_calibration(text, diagnosis);
  add_recordings(text, diagnosis);
  if (diagnosis.false_alarms) text << "  " << false_alarm_text(*diagnosis.false_alarms) << "\n";
  add_detection_limits(text, diagnosis.detection);
  add_trials(text, diagnosis);
  return text.str();
}

}  // namespace stickslip::report
