#include "diagnosis/report/report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>
#include <sstream>

#include "physics/number_text.h"

namespace stickslip::diagnosis {

namespace {

using Json = nlohmann::ordered_json;
using physics::number_text;

Json interval(const std::pair<double, double>& span) {
  return Json::array({span.first, span.second});
}

Json location_json(const Location& location) {
  Json json;
  json["relation"] = physics::name_of(location.relation);
  json["channel"] = location.channel ? Json(info(*location.channel).stem) : Json(nullptr);
  json["when_s"] = Json::array();
  for (const auto& span : location.when_s) json["when_s"].push_back(interval(span));
  json["where"] = Json::object();
  for (const auto& [name, span] : location.where) json["where"][name] = interval(span);
  json["band_hz"] = location.band_hz ? interval(*location.band_hz) : Json(nullptr);
  json["statement"] = location.statement;
  json["regions"] = Json::array();
  for (const Region& region : location.regions) {
    const bool measured = region.aspect != Aspect::motion;
    json["regions"].push_back({{"channel", info(region.channel).stem},
                               {"aspect", name_of(region.aspect)},
                               {"span", measured ? interval({region.from, region.to}) : nullptr},
                               {"words", region.words},
                               {"energy", region.energy},
                               {"energy_outside", region.energy_outside},
                               {"p_value", region.p_value}});
  }
  return json;
}

// What the contract calls it.
std::string_view id_of(const physics::Card& card) {
  return card.depends_on.empty() ? card.id : "unlisted";
}

Json finding_json(const Finding& finding) {
  const physics::Card& card = finding.effect->card();
  Json json;
  json["id"] = id_of(card);
  if (!card.depends_on.empty()) json["name"] = card.id;
  json["relation"] = physics::name_of(card.relation);
  json["channel"] = finding.place.channel ? Json(info(*finding.place.channel).stem) : Json(nullptr);
  json["statement"] = finding.statement;
  json["equation"] = card.equation;
  json["parameters"] = Json::object();
  if (!card.depends_on.empty()) {
    json["parameters"]["depends_on"] = Json::array();
    for (const std::string_view name : card.depends_on) {
      if (finding.place.channel && name != info(*finding.place.channel).stem) continue;
      json["parameters"]["depends_on"].push_back(name);
    }
  }
  for (const Estimate& estimate : finding.parameters) {
    json["parameters"][estimate.name] = {{"value", estimate.value},
                                         {"ci95", Json::array({estimate.low, estimate.high})}};
  }
  if (finding.when_s) json["when_s"] = Json::array({interval(*finding.when_s)});
  if (!card.depends_on.empty()) {
    json["shape"] = Json::array();
    for (const Curve& curve : finding.shape) {
      json["shape"].push_back({{"variable", curve.variable},
                               {"unit", curve.unit},
                               {"quantity", curve.quantity},
                               {"at", curve.at},
                               {"value", curve.value}});
    }
  }
  json["probability"] = finding.probability;
  json["alternatives"] = Json::array();
  for (const Alternative& each : finding.alternatives) {
    json["alternatives"].push_back({{"id", id_of(each.suspect.effect->card())},
                                    {"name", each.suspect.name()},
                                    {"probability", each.probability}});
  }
  json["separating_experiment"] =
      finding.separating_experiment ? Json(*finding.separating_experiment) : Json(nullptr);
  return json;
}

Json integrity_json(const Integrity& integrity) {
  Json json;  // without the file's name: the same recording gives the same bytes in either form
  json["duration_s"] = integrity.duration_s;
  json["rate_hz"] = integrity.rate_hz;
  json["frames"] = integrity.frames;
  json["lost"] = integrity.lost;
  json["longest_gap_s"] = integrity.longest_gap_s;
  json["jitter_periods"] = integrity.jitter;
  json["velocity_delay_s"] =
      integrity.velocity_delay_s ? Json(*integrity.velocity_delay_s) : Json(nullptr);
  json["channels"] = Json::object();
  for (const ChannelIntegrity& c : integrity.channels) {
    Json& channel = json["channels"][std::string(info(c.channel).stem)];
    channel["missing"] = c.missing;
    channel["lowest"] = c.lowest;
    channel["highest"] = c.highest;
    channel["step"] = c.step > 0.0 ? Json(c.step) : Json(nullptr);
    channel["at_low_rail"] = c.at_low_rail;
    channel["at_high_rail"] = c.at_high_rail;
    channel["mains"] =
        c.mains ? Json{{"frequency_hz", c.mains->frequency_hz}, {"amplitude", c.mains->amplitude}}
                : Json(nullptr);
  }
  json["remarks"] = integrity.remarks;
  return json;
}

Json detection_json(const Detection& detection) {
  Json json;
  json["limits"] = Json::array();
  for (const DetectionLimit& limit : detection.limits) {
    json["limits"].push_back({{"id", id_of(limit.suspect.effect->card())},
                              {"name", limit.suspect.name()},
                              {"parameter", limit.parameter().name},
                              {"value", limit.value}});
  }
  json["inseparable"] = Json::array();
  for (const Lookalikes& pair : detection.lookalikes) {
    json["inseparable"].push_back({{"one", detection.limits[pair.one].suspect.name()},
                                   {"other", detection.limits[pair.other].suspect.name()},
                                   {"cosine", pair.cosine}});
  }
  return json;
}

// The end of an interval, with three digits or as many as set it apart from the value.
std::string end_text(double end, double value) {
  char end_digits[40];
  char value_digits[40];
  for (int count = 3; count <= 17; ++count) {
    std::snprintf(end_digits, sizeof end_digits, "%.*g", count, end);
    std::snprintf(value_digits, sizeof value_digits, "%.*g", count, value);
    if (std::strcmp(end_digits, value_digits) != 0) return end_digits;
  }
  return number_text(end);
}

// From which size on the physics that the contract lists would have been named, and what of it
// could not have been told apart. Sensor effects fill a page: the other reports have them.
void list_limits(std::ostringstream& text, const Detection& detection) {
  const auto is_told = [](const Suspect& suspect) {
    return suspect.effect->card().depends_on.empty() && !suspect.place.channel;
  };
  const char* before = "  Would have been named, from these sizes on: ";
  for (const DetectionLimit& limit : detection.limits) {
    if (!is_told(limit.suspect)) continue;
    text << before << limit.suspect.name() << " (" << limit.parameter().name << " = "
         << value_text(limit) << ")";
    before = ", ";
  }
  if (before[0] == ',') text << "\n";
  before = "  Could not have been told apart: ";
  for (const Lookalikes& pair : detection.lookalikes) {
    const Suspect& one = detection.limits[pair.one].suspect;
    const Suspect& other = detection.limits[pair.other].suspect;
    if (!is_told(one) || !is_told(other)) continue;
    text << before << one.name() << " and " << other.name();
    before = "; ";
  }
  if (before[0] == ';') text << "\n";
}

// The plainest condition of each aspect, one line each.
std::vector<std::string> conditions_of(const Location& location) {
  std::vector<std::string> out;
  std::vector<Aspect> told;
  for (const Region& region : location.regions) {
    if (std::find(told.begin(), told.end(), region.aspect) != told.end()) continue;
    told.push_back(region.aspect);
    out.push_back(std::string(info(region.channel).stem)
                      .append(" is off more ")
                      .append(region.words)
                      .append(" (")
                      .append(number_text(std::sqrt(region.energy)))
                      .append(" times the noise, elsewhere ")
                      .append(number_text(std::sqrt(region.energy_outside)))
                      .append(")"));
  }
  return out;
}

std::string percent(double share) { return number_text(100.0 * share) + " %"; }

void list_prediction_errors(std::ostringstream& text, const Score& before,
                            const std::optional<Score>& after) {
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (!before.rmse[c]) continue;
    const ChannelInfo& channel = channel_table[c];
    text << "    " << channel.stem << ": " << number_text(*before.rmse[c]) << " " << channel.unit;
    if (after && after->rmse[c]) {
      text << " -> " << number_text(*after->rmse[c]) << " " << channel.unit;
    }
    text << "\n";
  }
}

}  // namespace

Json score_json(const Score& score, bool with_rmse) {
  Json json;
  json["chi2_per_sample"] = score.chi2_per_sample;
  json["nll_per_sample"] = score.nll_per_sample;
  json["nrmse"] = Json::object();
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (score.nrmse[c]) json["nrmse"][std::string(channel_table[c].stem)] = *score.nrmse[c];
  }
  if (with_rmse) {
    json["rmse"] = Json::object();
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      if (score.rmse[c]) json["rmse"][std::string(channel_table[c].column)] = *score.rmse[c];
    }
  }
  return json;
}

Json free_run_json(const FreeRun& run) {
  Json json;
  json["rmse"] = Json::object();
  json["nrmse"] = Json::object();
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (run.rmse[c]) json["rmse"][std::string(channel_table[c].column)] = *run.rmse[c];
    if (run.nrmse[c]) json["nrmse"][std::string(channel_table[c].stem)] = *run.nrmse[c];
  }
  return json;
}

std::string value_text(const DetectionLimit& limit) {
  return end_text(limit.value, limit.parameter().neutral);
}

std::string sentence_of(const FalseAlarms& alarms) {
  std::string out = "Of " + std::to_string(alarms.recordings) +
                    " recordings of the calibrated declared model, in which nothing is missing, " +
                    std::to_string(alarms.alarms) + " would have been accused";
  if (!alarms.chi2.empty()) {
    out += "; noise alone left a chi-squared of " + number_text(alarms.chi2.front()) + " to " +
           number_text(alarms.chi2.back()) + " per sample";
  }
  return out + ".";
}

Json report_json(const Diagnosis& diagnosis) {
  Json json;
  json["schema"] = 1;
  json["verdict"] = name_of(diagnosis.verdict);
  json["location"] = diagnosis.location ? location_json(*diagnosis.location) : Json(nullptr);
  json["findings"] = Json::array();
  for (const Finding& finding : diagnosis.findings)
    json["findings"].push_back(finding_json(finding));
  json["fit"]["heldout"]["baseline"] = score_json(diagnosis.baseline, false);
  // Where nothing was added, the augmented model is the declared one.
  json["fit"]["heldout"]["augmented"] =
      score_json(diagnosis.augmented.value_or(diagnosis.baseline), false);
  json["fit"]["horizon_s"] = diagnosis.horizon_s;
  json["calibrated"] = Json::object();
  for (const Calibration& each : diagnosis.calibrated) json["calibrated"][each.path] = each.value;
  json["noise_std"] = Json::object();
  for (const auto& [channel, value] : diagnosis.noise_std) {
    json["noise_std"][std::string(info(channel).column)] = value;
  }
  json["detection"] = detection_json(diagnosis.detection);
  if (diagnosis.false_alarms) {
    const FalseAlarms& alarms = *diagnosis.false_alarms;
    json["bootstrap"] = {{"recordings", alarms.recordings},
                         {"alarms", alarms.alarms},
                         {"baseline_chi2_per_sample", alarms.chi2}};
  }
  json["integrity"] = Json::array();
  for (const Integrity& each : diagnosis.integrity) {
    json["integrity"].push_back(integrity_json(each));
  }
  return json;
}

std::string report_text(const Diagnosis& diagnosis) {
  std::ostringstream text;
  switch (diagnosis.verdict) {
    case Verdict::consistent:
      text << "CONSISTENT: nothing beyond the noise; the model explains the recording.\n";
      break;
    case Verdict::missing_physics:
      text << "MISSING PHYSICS: " << diagnosis.findings.size()
           << (diagnosis.findings.size() == 1 ? " effect was" : " effects were")
           << " left out of the model.\n";
      break;
    case Verdict::unexplained:
      text << "UNEXPLAINED: there is a mismatch, and nothing tried explains "
           << (diagnosis.findings.empty() ? "it" : "all of it") << " well enough.\n";
      break;
  }
  if (diagnosis.location) {
    text << "  Where: " << diagnosis.location->statement << "\n";
    for (const std::string& line : conditions_of(*diagnosis.location)) {
      text << "         " << line << "\n";
    }
  }
  int number = 0;
  for (const Finding& finding : diagnosis.findings) {
    text << "  " << ++number << ". " << Suspect{finding.effect, finding.place}.name() << ": "
         << finding.statement << "\n";
    for (const Estimate& estimate : finding.parameters) {
      text << "       " << estimate.name << " = " << number_text(estimate.value)
           << "  (95 %: " << end_text(estimate.low, estimate.value) << " to "
           << end_text(estimate.high, estimate.value) << ")\n";
    }
    text << "       held-out chi-squared per sample " << number_text(finding.chi2_before) << " -> "
         << number_text(finding.chi2_after) << "; probability among what was tried "
         << percent(finding.probability) << "\n";
    for (const Alternative& each : finding.alternatives) {
      text << "       or " << each.suspect.name() << " (" << percent(each.probability) << ")\n";
    }
    if (finding.separating_experiment) {
      text << "       to tell: " << *finding.separating_experiment << "\n";
    }
  }
  text << "  Held-out predictions, " << number_text(diagnosis.horizon_s)
       << " s ahead, root mean square error:\n";
  list_prediction_errors(text, diagnosis.baseline, diagnosis.augmented);
  text << "  Held-out chi-squared per sample: " << number_text(diagnosis.baseline.chi2_per_sample);
  if (diagnosis.augmented) text << " -> " << number_text(diagnosis.augmented->chi2_per_sample);
  text << "  (1: only noise is left; " << diagnosis.fitted_windows << " windows fitted, "
       << diagnosis.heldout_windows << " held out)\n";
  if (!diagnosis.noise_estimated.empty()) {
    text << "  Noise estimated from the recording, not declared:";
    for (const Channel channel : diagnosis.noise_estimated) text << " " << info(channel).stem;
    text << "\n";
  }
  if (!diagnosis.calibrated.empty()) {
    text << "  Calibrated (in brackets: sigmas from the model's value):";
    bool far = false;
    for (const Calibration& each : diagnosis.calibrated) {
      char off[32];
      std::snprintf(off, sizeof off, " (%+.1f);", each.sigmas_off);
      text << " " << each.path << " = " << number_text(each.value) << off;
      far = far || std::abs(each.sigmas_off) > 3.0;
    }
    text << "\n";
    if (far) {
      text << "  Beyond 3 sigma: either that sigma is too small, or this parameter stands in for "
              "physics that is not in the model.\n";
    }
  }
  for (const Integrity& each : diagnosis.integrity) {
    text << "  Recording " << each.source << ": " << number_text(each.duration_s) << " s at "
         << number_text(each.rate_hz) << " Hz";
    if (each.remarks.empty()) text << "; whole, no channel at its rails, no line of the mains";
    text << "\n";
    for (const std::string& remark : each.remarks) text << "    " << remark << "\n";
  }
  if (diagnosis.false_alarms) text << "  " << sentence_of(*diagnosis.false_alarms) << "\n";
  list_limits(text, diagnosis.detection);
  text << "  Tried:";
  int stage = 0;
  for (const Trial& trial : diagnosis.trials) {
    if (trial.stage != stage) {
      stage = trial.stage;
      text << " | then";
    }
    text << " " << trial.id << " (" << number_text(trial.heldout_chi2) << ")";
  }
  text << "\n";
  return text.str();
}

}  // namespace stickslip::diagnosis
