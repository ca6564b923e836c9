// SPDX-License-Identifier: Apache-2.0
#include "tools/concealment/grading.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace stickslip::concealment {

namespace {

using Json = nlohmann::ordered_json;
using Spans = std::vector<std::pair<double, double>>;

Spans merged(Spans spans) {
  std::sort(spans.begin(), spans.end());
  Spans out;
  for (const auto& span : spans) {
    if (!out.empty() && span.first <= out.back().second) {
      out.back().second = std::max(out.back().second, span.second);
    } else {
      out.push_back(span);
    }
  }
  return out;
}

// Length of the intersection of two sets of intervals over that of their union.
double overlap_of(const Spans& a, const Spans& b) {
  const Spans one = merged(a);
  const Spans other = merged(b);
  double shared = 0.0;
  double covered = 0.0;
  for (const auto& x : one) covered += x.second - x.first;
  for (const auto& y : other) covered += y.second - y.first;
  for (const auto& x : one) {
    for (const auto& y : other) {
      shared += std::max(0.0, std::min(x.second, y.second) - std::max(x.first, y.first));
    }
  }
  covered -= shared;
  return covered > 0.0 ? shared / covered : 0.0;
}

Spans spans_of(const Json& json) {
  Spans spans;
  if (!json.is_array()) return spans;
  for (const Json& each : json) {
    if (each.is_array() && each.size() == 2) {
      spans.emplace_back(each[0].get<double>(), each[1].get<double>());
    }
  }
  return spans;
}

std::string text_at(const Json& json, const char* key) {
  return json.contains(key) && json[key].is_string() ? json[key].get<std::string>() : std::string();
}

bool contains(const std::vector<std::string>& list, const std::string& word) {
  return std::find(list.begin(), list.end(), word) != list.end();
}

std::optional<double> chi2_at(const Json& report, const char* which) {
  const auto path = Json::json_pointer(std::string("/fit/heldout/") + which + "/chi2_per_sample");
  if (!report.contains(path) || !report[path].is_number()) return std::nullopt;
  return report[path].get<double>();
}

void grade_parameters(Grade& out, const TrueEffect& effect, const Json* finding) {
  for (const auto& [name, truth] : effect.parameters) {
    if (!truth.graded) continue;
    ++out.parameters;
    if (finding == nullptr || !finding->at("parameters").contains(name)) continue;
    const Json& reported = finding->at("parameters").at(name);
    double value = reported.at("value").get<double>();
    double low = reported.at("ci95").at(0).get<double>();
    double high = reported.at("ci95").at(1).get<double>();
    if (truth.sign_free && value * truth.value < 0.0) {
      value = -value;
      std::swap(low, high);
      low = -low;
      high = -high;
    }
    const double error = std::abs(value - truth.value) / std::abs(truth.value - truth.reference);
    if (error <= truth.tolerance) ++out.within_tolerance;
    if (error <= 0.1) ++out.within_tenth;
    if (low <= truth.value && truth.value <= high) ++out.covered;
  }
}

// True for a finding by its id, or of a number by its path: "declared_value of friction.mu".
bool names(const TrueEffect& effect, const Json& finding) {
  const std::string id = text_at(finding, "id");
  return contains(effect.accept, id) ||
         contains(effect.accept, id + " of " + text_at(finding, "parameter"));
}

// The finding that names each hidden effect, of several the one at its channel; nullptr if none.
std::vector<const Json*> matches_of(const GroundTruth& truth, const Json& findings, Grade& out) {
  std::vector<const Json*> match(truth.effects.size(), nullptr);
  std::vector<bool> taken(findings.size(), false);
  for (std::size_t i = 0; i < truth.effects.size(); ++i) {
    const TrueEffect& effect = truth.effects[i];
    std::optional<std::size_t> best;
    for (std::size_t k = 0; k < findings.size(); ++k) {
      if (taken[k] || !names(effect, findings[k])) continue;
      const bool here =
          effect.channel && text_at(findings[k], "channel") == info(*effect.channel).stem;
      if (!best || here) best = k;
      if (here) break;
    }
    if (!best) continue;
    taken[*best] = true;
    match[i] = &findings[*best];
  }
  out.surplus = static_cast<int>(std::count(taken.begin(), taken.end(), false));
  return match;
}

bool depends_on_any(const Json& finding, const std::vector<std::string>& variables) {
  const Json names = finding.at("parameters").value("depends_on", Json::array());
  return std::any_of(names.begin(), names.end(), [&](const Json& name) {
    return contains(variables, name.get<std::string>());
  });
}

// `match`: the finding that names the effect, or nullptr.
void grade_effect(Grade& out, const TrueEffect& effect, const Json* match, const Json& findings,
                  const Json& location) {
  const Json* finding = match != nullptr ? match : (findings.empty() ? nullptr : &findings.front());
  const std::string located = location.is_object() ? text_at(location, "relation") : "";
  const std::string relation = finding != nullptr ? text_at(*finding, "relation") : located;
  out.relation_right = out.relation_right && contains(effect.relations, relation);
  if (effect.channel) {
    const bool here = match != nullptr && text_at(*match, "channel") == info(*effect.channel).stem;
    out.channel_right = out.channel_right.value_or(true) && here;
  }
  if (!effect.when_s.empty()) {
    Spans reported;
    if (match != nullptr && match->contains("when_s")) {
      reported = spans_of(match->at("when_s"));
    } else if (location.is_object()) {
      reported = spans_of(location.value("when_s", Json::array()));
    }
    out.overlap = overlap_of(reported, effect.when_s);
  }
  if (!effect.depends_on.empty()) {
    out.depends_right = match != nullptr && depends_on_any(*match, effect.depends_on);
  }
  const bool by_its_id = match != nullptr && text_at(*match, "id") == effect.id;
  grade_parameters(out, effect, by_its_id ? match : nullptr);
}

}  // namespace

Grade grade(const GroundTruth& truth, const Json& report) {
  Grade out;
  out.name = truth.name;
  out.kind = truth.kind;
  for (const auto& [nuisance, drawn] : truth.nuisances.items()) out.nuisances.push_back(nuisance);
  if (truth.kind == "single" && truth.effects.size() == 1 && truth.effects[0].snr > 0.0) {
    out.snr = truth.effects[0].snr;
  }
  for (const TrueEffect& effect : truth.effects) {
    out.hidden.push_back(effect.physics.empty() ? effect.id : effect.physics);
  }
  if (report.is_null()) {
    out.missed = !truth.effects.empty();
    for (const TrueEffect& effect : truth.effects) grade_parameters(out, effect, nullptr);
    return out;
  }
  out.verdict = report.at("verdict").get<std::string>();
  out.verdict_right = out.verdict == truth.verdict;
  out.chi2_before = chi2_at(report, "baseline");
  out.chi2_after = chi2_at(report, "augmented");
  const Json& findings = report.at("findings");
  for (const Json& finding : findings) out.named.push_back(text_at(finding, "id"));
  if (truth.effects.empty()) {
    out.false_alarm = out.verdict != "consistent";
    out.surplus = static_cast<int>(findings.size());
    out.exact = out.first_right = out.relation_right = out.all_named = out.verdict_right;
    return out;
  }
  out.missed = out.verdict == "consistent";
  const std::vector<const Json*> match = matches_of(truth, findings, out);
  out.found = static_cast<int>(
      std::count_if(match.begin(), match.end(), [](const Json* m) { return m != nullptr; }));
  out.all_named = out.found == static_cast<int>(match.size());
  out.first_right = !out.named.empty() &&
                    std::any_of(truth.effects.begin(), truth.effects.end(),
                                [&](const TrueEffect& e) { return names(e, findings.front()); });
  const Json location = report.value("location", Json(nullptr));
  out.relation_right = true;
  for (std::size_t i = 0; i < match.size(); ++i) {
    grade_effect(out, truth.effects[i], match[i], findings, location);
  }
  out.exact = out.verdict_right && out.all_named && out.surplus == 0 &&
              out.channel_right.value_or(true) && out.depends_right.value_or(true);
  return out;
}

Rate rate_interval(int hits, int count) {
  if (count <= 0) return {};
  constexpr double z = 1.959964;
  const double n = count;
  const double p = hits / n;
  const double middle = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
  const double half = z / (1.0 + z * z / n) * std::sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n));
  return {std::max(0.0, middle - half), std::min(1.0, middle + half)};
}

StudyGrade study_grade(const GroundTruth& truth, const Json& study) {
  constexpr double certain = 0.95;
  StudyGrade out;
  out.runs = study.at("runs").get<int>();
  out.rig_time_s = study.at("rig_time_s").get<double>();
  out.used_share = study.at("used_share").get<double>();
  const Json& first = study.at("first");
  const bool is_right = grade(truth, first).first_right;
  const auto probability = [&first] {
    return first.at("findings").front().at("probability").get<double>();
  };
  out.open_after_first = !is_right || (!truth.effects.empty() && probability() < certain);
  return out;
}

}  // namespace stickslip::concealment
