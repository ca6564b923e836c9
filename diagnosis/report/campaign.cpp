// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/report/campaign.h"

#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>

#include "diagnosis/report/formatting.h"
#include "diagnosis/report/json.h"
#include "physics/number_text.h"
#include "physics/result_units.h"

namespace stickslip::report {

using namespace diagnosis;
using physics::number_text;
using physics::Sharing;

namespace {

using Json = nlohmann::ordered_json;

// The finding that a number belongs to.
std::optional<std::size_t> finding_of(const Diagnosis& d, const Comparison& comparison) {
  for (std::size_t i = 0; i < d.findings.size(); ++i) {
    const CandidateEffect candidate = d.findings[i];
    std::string path = "physics." + std::string(candidate.effect->card().id) + ".";
    if (candidate.place.channel) path += std::string(info(*candidate.place.channel).stem) + ".";
    const bool is_number = candidate.is_number() && candidate.parameter == comparison.number.path;
    if (is_number || comparison.number.path.starts_with(path)) return i;
  }
  return std::nullopt;
}

// "0.4328 N (95 %: 0.4326 to 0.4331)"
std::string estimate_words(double value, double low, double high, const std::string& unit = "") {
  const EstimateText text = format_estimate(value, low, high);
  return text.value + unit + " (95 %: " + interval_text(value, low, high) + ")";
}

std::string unit_after(const Diagnosis& d, const Comparison& each) {
  return physics::ResultUnits(d.model).after_number(each.unit);
}

std::string sharing_words(const Comparison& each) {
  const std::string& condition = each.number.condition;
  switch (each.number.sharing) {
    case Sharing::common:
      return "common to all";
    case Sharing::own:
      return "each recording's own";
    case Sharing::varies:
      return "varies around a common mean";
    case Sharing::proportional:
      return "proportional to " + condition;
    case Sharing::power:
      return each.trend && each.trend->exponent ? "a power of " + condition
                                                : "linear in the logarithm of " + condition;
    case Sharing::linear:
      return "linear in " + condition;
  }
  return "";
}

std::string trend_words(const Comparison& each) {
  const Trend& trend = *each.trend;
  std::string name = "coefficient";
  if (each.number.sharing == Sharing::power) {
    name = trend.exponent ? "exponent" : "change per e-fold of " + each.number.condition;
  } else if (each.number.sharing == Sharing::linear) {
    name = "change per unit of " + each.number.condition;
  }
  return name + " " + estimate_words(trend.value, trend.low, trend.high);
}

// The value that the recordings share, its dependence and its spread.
std::string shared_words(const Comparison& each, const std::string& unit) {
  std::string out = each.number.path + ", " + sharing_words(each) + ": " +
                    estimate_words(each.value, each.low, each.high, unit);
  if (each.trend) out += "; " + trend_words(each);
  if (each.spread) {
    out +=
        "; spread " + estimate_words(each.spread->value, each.spread->low, each.spread->high, unit);
  }
  return out;
}

std::string test_words(const Comparison& each) {
  std::string subject = "a common value is ";
  if (each.number.sharing == Sharing::proportional) subject = "a common coefficient is ";
  if (each.number.sharing == Sharing::power || each.number.sharing == Sharing::linear) {
    subject = "the dependence is ";
  }
  if (each.freedom < 1) return "two recordings alone determine the dependence";
  return subject + (each.tenable ? "tenable" : "not tenable") + " (Q = " + number_text(each.q, 3) +
         " with " + physics::counted(static_cast<std::size_t>(each.freedom), "degree") +
         " of freedom, p = " + number_text(each.p, 2) + ")";
}

std::string disagreeing_words(const CampaignResult& result, const Comparison& each) {
  std::string out;
  std::size_t count = 0;
  for (const OwnValue& own : each.own) {
    if (!own.disagrees) continue;
    out += (out.empty() ? "" : ", ") + result.campaign.runs[own.recording].name;
    ++count;
  }
  if (count == each.own.size() && count > 0) {
    return count == 2 ? "the two disagree" : "no two parts of the recordings agree";
  }
  return out.empty() ? out : "disagrees: " + out;
}

std::string conditions_text(const physics::Run& run) {
  std::string out;
  for (const auto& [name, value] : run.conditions) {
    out += (out.empty() ? "" : ", ") + name + " = " + number_text(value);
  }
  for (const auto& [name, text] : run.remarks) {
    out += (out.empty() ? "" : ", ") + name + ": " + text;
  }
  return out;
}

void add_comparison(std::ostringstream& text, const Diagnosis& d, const Comparison& each) {
  const std::string unit = unit_after(d, each);
  text << "    " << shared_words(each, unit) << "\n";
  for (const OwnValue& own : each.own) {
    text << "      " << d.campaign->campaign.runs[own.recording].name << ": "
         << estimate_words(own.value, own.low, own.high, unit)
         << (own.disagrees ? ", disagrees" : "") << "\n";
  }
  text << "      " << test_words(each);
  const std::string who = disagreeing_words(*d.campaign, each);
  text << (who.empty() ? "" : "; " + who) << "\n";
}

Json span_json(double low, double high) { return Json::array({low, high}); }

Json comparison_json(const Diagnosis& d, const Comparison& each) {
  Json json;
  json["path"] = each.number.path;
  const auto finding = finding_of(d, each);
  json["finding"] = finding ? Json(*finding) : Json(nullptr);
  json["sharing"] = physics::name_of(each.number.sharing);
  json["condition"] = each.number.condition.empty() ? Json(nullptr) : Json(each.number.condition);
  json["value"] = each.value;
  json["unit"] = physics::ResultUnits(d.model).of(each.unit);
  json["ci95"] = span_json(each.low, each.high);
  json["recordings"] = Json::array();
  for (const OwnValue& own : each.own) {
    json["recordings"].push_back({{"name", d.campaign->campaign.runs[own.recording].name},
                                  {"value", own.value},
                                  {"ci95", span_json(own.low, own.high)},
                                  {"disagrees", own.disagrees}});
  }
  json["heterogeneity"] = {
      {"q", each.q}, {"freedom", each.freedom}, {"p", each.p}, {"tenable", each.tenable}};
  json["trend"] = nullptr;
  if (each.trend) {
    json["trend"] = {{"value", each.trend->value},
                     {"ci95", span_json(each.trend->low, each.trend->high)}};
  }
  json["spread"] = nullptr;
  if (each.spread) {
    json["spread"] = {{"value", each.spread->value},
                      {"ci95", span_json(each.spread->low, each.spread->high)}};
  }
  return json;
}

Table comparison_table(const Diagnosis& d, const Comparison& each) {
  const std::string unit = unit_after(d, each);
  Table table(plain_text(shared_words(each, unit) + "; " + test_words(each) + "."),
              {"recording", "conditions", "value", "95 % interval", "agrees"});
  for (const OwnValue& own : each.own) {
    const physics::Run& run = d.campaign->campaign.runs[own.recording];
    const EstimateText text = format_estimate(own.value, own.low, own.high);
    table.row({escape_html(run.name), escape_html(conditions_text(run)), text.value + unit,
               interval_text(own.value, own.low, own.high), own.disagrees ? "no" : "yes"});
  }
  return table;
}

}  // namespace

std::string campaign_text(const Diagnosis& d) {
  std::ostringstream text;
  const CampaignResult& result = *d.campaign;
  text << "  Campaign of " << physics::counted(result.campaign.runs.size(), "recording") << ":\n";
  for (const Comparison& each : result.comparisons) {
    if (finding_of(d, each) || !each.tenable || each.number.sharing != Sharing::common) {
      add_comparison(text, d, each);
    }
  }
  for (const HeldOutRecording& each : result.held_out) {
    text << "    held out, " << result.campaign.runs[each.recording].name << ": RMS error up to "
         << number_text(d.horizon_s) << physics::ResultUnits(d.model).after_number("s") << " ahead";
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      if (!each.baseline.rmse[c]) continue;
      const std::string unit = physics::ResultUnits(d.model).after_number(channel_table[c].unit);
      text << "; " << channel_table[c].stem << " " << number_text(*each.baseline.rmse[c]) << unit;
      if (each.augmented) text << " -> " << number_text(*each.augmented->rmse[c]) << unit;
    }
    text << "\n";
  }
  return text.str();
}

Json campaign_json(const Diagnosis& d) {
  const CampaignResult& result = *d.campaign;
  Json json;
  json["recordings"] = Json::array();
  for (const physics::Run& run : result.campaign.runs) {
    json["recordings"].push_back({{"name", run.name},
                                  {"conditions", Json(run.conditions)},
                                  {"set", Json(run.settings)},
                                  {"held_out", run.held_out}});
  }
  json["comparisons"] = Json::array();
  for (const Comparison& each : result.comparisons) {
    json["comparisons"].push_back(comparison_json(d, each));
  }
  json["held_out"] = Json::array();
  for (const HeldOutRecording& each : result.held_out) {
    json["held_out"].push_back(
        {{"name", result.campaign.runs[each.recording].name},
         {"baseline", score_json(each.baseline, true)},
         {"augmented", score_json(each.augmented.value_or(each.baseline), true)}});
  }
  return json;
}

Section campaign_section(const Diagnosis& d) {
  Section out("campaign", "Recordings compared");
  if (!d.campaign) return out;
  out += paragraph(
      "Each number as each recording determines it for itself, with all other numbers as fitted to "
      "the whole campaign. Q: weighted sum of squares about what the recordings share (Cochran); "
      "tenable: at 5 % over all tables together (Holm).");
  for (const bool of_findings : {true, false}) {
    for (const Comparison& each : d.campaign->comparisons) {
      if (finding_of(d, each).has_value() == of_findings) out += comparison_table(d, each).html();
    }
  }
  for (const HeldOutRecording& each : d.campaign->held_out) {
    Table table("Held out: " + d.campaign->campaign.runs[each.recording].name +
                    ". RMS prediction error up to " +
                    format_seconds(d.horizon_s, physics::ResultUnits(d.model)) + " ahead.",
                {"quantity", "declared model", "augmented model"});
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      if (!each.baseline.rmse[c]) continue;
      const auto unit = physics::ResultUnits(d.model).of(channel_table[c].unit);
      const double before = *each.baseline.rmse[c];
      const bool changed = each.augmented && each.augmented->rmse[c];
      table.row({escape_html(channel_name(all_channels[c])), format_quantity(before, unit),
                 changed ? format_quantity(*each.augmented->rmse[c], unit, before)
                         : escape_html("the same")});
    }
    out += table.html();
  }
  return out;
}

}  // namespace stickslip::report
