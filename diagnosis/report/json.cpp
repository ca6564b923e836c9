// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/report/json.h"

#include <nlohmann/json.hpp>

#include "diagnosis/report/campaign.h"
#include "physics/declared_value.h"
#include "physics/result_units.h"

namespace stickslip::report {

using namespace diagnosis;

namespace {

using Json = nlohmann::ordered_json;

Json interval(const std::pair<double, double>& span) {
  return Json::array({span.first, span.second});
}

Json balances_json(const Balances& balances) {
  Json json;
  for (const Balance each : all_balances) {
    const auto& found = balances[each];
    json[std::string(name_of(each))] =
        found ? Json{{"excess", found->excess}, {"p", found->p}} : Json(nullptr);
  }
  return json;
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
  json["balances"] = balances_json(location.balances);
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

// The id in reports (docs/formats.md, section 6).
std::string_view id_of(const physics::Card& card) {
  return card.depends_on.empty() ? card.id : "unlisted";
}

Json finding_json(const Finding& finding) {
  const physics::Card& card = finding.effect->card();
  Json json;
  json["id"] = id_of(card);
  if (!card.depends_on.empty()) json["name"] = card.id;
  if (!finding.parameter.empty()) json["parameter"] = finding.parameter;
  if (!finding.shared.path.empty()) {
    json["sharing"] = {
        {"path", finding.shared.path},
        {"form", physics::name_of(finding.shared.sharing)},
        {"condition",
         finding.shared.condition.empty() ? Json(nullptr) : Json(finding.shared.condition)}};
  }
  json["relation"] = physics::name_of(finding.relation());
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
                                         {"unit", estimate.unit},
                                         {"ci95", interval({estimate.low, estimate.high})},
                                         {"formula_uncertainty", estimate.formula_uncertainty}};
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
  json["score_gain"] = {{"value", finding.gain.value}, {"se", finding.gain.se}, {"unit", "nat"}};
  json["preferred_over"] = Json::array();
  for (const CandidateEffect& each : finding.preferred_over) {
    json["preferred_over"].push_back({{"id", id_of(each.effect->card())}, {"name", each.name()}});
  }
  json["alternatives"] = Json::array();
  for (const Alternative& each : finding.alternatives) {
    json["alternatives"].push_back({{"id", id_of(each.candidate.effect->card())},
                                    {"name", each.candidate.name()},
                                    {"probability", each.probability}});
    if (each.candidate.is_number()) {
      json["alternatives"].back()["parameter"] = each.candidate.parameter;
    }
  }
  json["separating_experiment"] =
      finding.separating_experiment ? Json(*finding.separating_experiment) : Json(nullptr);
  return json;
}

Json calibration_json(const Calibration& calibration, const physics::Model& model,
                      const physics::ResultUnits& units) {
  return {{"value", calibration.value},
          {"ci95", interval({calibration.low, calibration.high})},
          {"declared", calibration.declared},
          {"declared_sigma", calibration.sigma},
          {"unit", units.of(physics::unit_of(calibration.path, model))}};
}

Json noise_json(const Diagnosis& diagnosis) {
  Json json = Json::object();
  for (const Noise& noise : diagnosis.noise) {
    json[std::string(info(noise.channel).stem)] = {{"std", noise.std},
                                                   {"correlation_s", noise.correlation_s},
                                                   {"source", name_of(noise.source)}};
  }
  return json;
}

Json tried_json(const std::vector<Trial>& trials) {
  Json json = Json::array();
  for (const Trial& trial : trials) {
    json.push_back({{"ids", Json::array({trial.effect})},
                    {"beside", trial.stage},
                    {"score_gain", trial.gain.value},
                    {"se", trial.gain.se}});
  }
  return json;
}

Json integrity_json(const Integrity& integrity) {
  Json json;  // no file name: CSV and log of the same recording give the same bytes
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
    channel["outliers"] = Json::array();
    for (const Outlier& each : c.outliers) {
      channel["outliers"].push_back({{"time_s", each.time_s}, {"value", each.value}});
    }
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
    json["limits"].push_back({{"id", id_of(limit.candidate.effect->card())},
                              {"name", limit.candidate.name()},
                              {"parameter", limit.parameter().name},
                              {"value", limit.value}});
  }
  json["inseparable"] = Json::array();
  for (const InseparablePair& pair : detection.inseparable) {
    json["inseparable"].push_back({{"one", detection.limits[pair.one].candidate.name()},
                                   {"other", detection.limits[pair.other].candidate.name()},
                                   {"cosine", pair.cosine}});
  }
  return json;
}

}  // namespace

Json provenance_json(const Provenance& provenance) {
  Json json = {{"version", provenance.version},
               {"seed", provenance.seed},
               {"command", provenance.command},
               {"sha256", Json::object()}};
  for (const Provenance::File& file : provenance.files) json["sha256"][file.name] = file.sha256;
  if (provenance.candidates) {
    json["sha256"][provenance.candidates->name] = provenance.candidates->sha256;
  }
  return json;
}

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

Json report_json(const Diagnosis& diagnosis, const Provenance& provenance) {
  Json json;
  json["schema"] = 1;
  if (diagnosis.model.dimensionless) json["dimensionless"] = true;
  json["verdict"] = name_of(diagnosis.verdict);
  json["location"] = diagnosis.location ? location_json(*diagnosis.location) : Json(nullptr);
  json["findings"] = Json::array();
  for (const Finding& finding : diagnosis.findings)
    json["findings"].push_back(finding_json(finding));
  json["fit"]["heldout"]["baseline"] = score_json(diagnosis.baseline, false);
  // Without findings the augmented model is the declared one.
  json["fit"]["heldout"]["augmented"] =
      score_json(diagnosis.augmented.value_or(diagnosis.baseline), false);
  json["fit"]["horizon_s"] = diagnosis.horizon_s;
  json["fit"]["windows"] = {{"fit", diagnosis.windows.fit},
                            {"select", diagnosis.windows.select},
                            {"report", diagnosis.windows.report}};
  json["calibrated"] = Json::object();
  for (const Calibration& each : diagnosis.calibrated) json["calibrated"][each.path] = each.value;
  json["calibration"] = Json::object();
  const physics::ResultUnits units(diagnosis.model);
  for (const Calibration& each : diagnosis.calibrated) {
    json["calibration"][each.path] = calibration_json(each, diagnosis.model, units);
  }
  json["noise_std"] = Json::object();
  for (const auto& [channel, value] : diagnosis.noise_std) {
    json["noise_std"][std::string(info(channel).column)] = value;
  }
  json["noise"] = noise_json(diagnosis);
  json["noise_level"] = Json::object();
  for (const auto& [channel, level] : diagnosis.noise_level) {
    json["noise_level"][std::string(info(channel).stem)] = level;
  }
  json["tried"] = tried_json(diagnosis.trials);
  json["detection"] = detection_json(diagnosis.detection);
  if (diagnosis.false_alarms) {
    const FalseAlarms& alarms = *diagnosis.false_alarms;
    json["bootstrap"] = {{"recordings", alarms.recordings},
                         {"alarms", alarms.alarms},
                         {"baseline_chi2_per_sample", alarms.chi2}};
  }
  if (diagnosis.campaign) json["campaign"] = campaign_json(diagnosis);
  json["integrity"] = Json::array();
  for (const Integrity& each : diagnosis.integrity) {
    json["integrity"].push_back(integrity_json(each));
  }
  json["provenance"] = provenance_json(provenance);
  return json;
}

}  // namespace stickslip::report
