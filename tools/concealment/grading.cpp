#include "tools/concealment/grading.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
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

// The finding that names each hidden effect, of several the one at its channel; nullptr if none.
std::vector<const Json*> matches_of(const GroundTruth& truth, const Json& findings, Grade& out) {
  std::vector<const Json*> match(truth.effects.size(), nullptr);
  std::vector<bool> taken(findings.size(), false);
  for (std::size_t i = 0; i < truth.effects.size(); ++i) {
    const TrueEffect& effect = truth.effects[i];
    std::optional<std::size_t> best;
    for (std::size_t k = 0; k < findings.size(); ++k) {
      if (taken[k] || !contains(effect.accept, out.named[k])) continue;
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
  out.all_named =
      std::all_of(match.begin(), match.end(), [](const Json* m) { return m != nullptr; });
  out.first_right = !out.named.empty() && std::any_of(truth.effects.begin(), truth.effects.end(),
                                                      [&](const TrueEffect& e) {
                                                        return contains(e.accept, out.named[0]);
                                                      });
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

namespace {

// Hits among the grades to which a criterion applies.
struct Tally {
  std::string_view key;  ///< in the JSON
  std::string_view label;
  int hits = 0;
  int count = 0;
  void add(bool hit) {
    ++count;
    if (hit) ++hits;
  }
  void add(std::optional<bool> hit) {
    if (hit) add(*hit);
  }
  void add(int some, int all) {
    hits += some;
    count += all;
  }
};

std::optional<bool> improved(const Grade& g) {
  if (!g.validation_before || !g.validation_after) return std::nullopt;
  return g.hidden.empty() ? *g.validation_after < 1.1 * *g.validation_before
                          : *g.validation_after < 0.9 * *g.validation_before;
}

std::vector<Tally> tallies_of(std::span<const Grade> grades) {
  Tally first{"single effects named right first", "single effects: first finding correct"};
  Tally exact{"single effects exact (nothing more)", "single effects: exact"};
  Tally relation{"relation right", "relation correct"};
  Tally null{"nothing hidden called consistent", "no hidden effect: consistent"};
  Tally pairs{"both of two named, nothing more", "two effects: both found, no surplus"};
  Tally unlisted{"unlisted physics called so", "unlisted physics: reported as unlisted"};
  Tally unlisted_relation{"unlisted physics at the right relation",
                          "unlisted physics: relation correct"};
  Tally wrong{"unlisted physics given a wrong name", "unlisted physics: wrong effect reported"};
  Tally channel{"channel right", "channel correct"};
  Tally tenth{"parameters within 10 %", "parameters within 10 %"};
  Tally within{"parameters within their tolerance", "parameters within tolerance"};
  Tally covered{"95 % intervals that hold the truth", "coverage of the 95 % intervals"};
  Tally when{"events found with an overlap above 0.8", "events: overlap above 0.8"};
  Tally floor{"held-out chi-squared at most 1.15 where named",
              "exact reports: held-out chi-squared <= 1.15"};
  Tally better{"better on another run", "validation run predicted better"};
  for (const Grade& g : grades) {
    if (g.kind == "null") {
      null.add(!g.false_alarm && g.verdict_right);
    } else {
      relation.add(g.relation_right);
      if (g.kind == "single") {
        first.add(g.first_right);
        exact.add(g.exact);
      } else if (g.kind == "pair") {
        pairs.add(g.exact);
      } else {
        unlisted.add(g.first_right);
        unlisted_relation.add(g.relation_right);
        wrong.add(!g.first_right && !g.named.empty());
      }
      if (g.exact && g.chi2_after) floor.add(*g.chi2_after <= 1.15);
    }
    channel.add(g.channel_right);
    tenth.add(g.within_tenth, g.parameters);
    within.add(g.within_tolerance, g.parameters);
    covered.add(g.covered, g.parameters);
    if (g.overlap) when.add(*g.overlap > 0.8);
    better.add(improved(g));
  }
  return {first, exact,  relation, null, pairs, unlisted, unlisted_relation, wrong, channel,
          tenth, within, covered,  when, floor, better};
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " + ") + word;
  return text;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

std::string row_of(const Grade& g) { return g.hidden.empty() ? "(nothing)" : joined(g.hidden); }
std::string column_of(const Grade& g) {
  if (g.verdict.empty()) return "(no report)";
  if (g.named.empty()) return g.verdict == "consistent" ? "(nothing)" : "(unexplained)";
  return joined(g.named);
}

struct Group {
  std::vector<double> chi2, seconds;
  int first = 0, exact = 0, relation = 0;
  int parameters = 0, within = 0, covered = 0;

  void add(const Grade& g) {
    first += g.first_right ? 1 : 0;
    exact += g.exact ? 1 : 0;
    relation += g.relation_right ? 1 : 0;
    parameters += g.parameters;
    within += g.within_tolerance;
    covered += g.covered;
    if (g.chi2_after) chi2.push_back(*g.chi2_after);
    seconds.push_back(g.seconds);
  }
};

std::string table_text(std::span<const Grade> grades) {
  std::map<std::string, Group> groups;
  for (const Grade& g : grades) {
    groups[g.kind == "pair" ? "(two effects)" : row_of(g)].add(g);
  }
  char line[240];
  std::snprintf(line, sizeof line, "%-33s %3s %7s %7s %8s %8s %7s %9s %7s\n", "hidden", "n",
                "first", "exact", "relation", "within", "covered", "chi2", "s");
  std::string text = line;
  for (const auto& [hidden, group] : groups) {
    const int n = static_cast<int>(group.seconds.size());
    std::snprintf(line, sizeof line,
                  "%-33s %3d %3d/%-3d %3d/%-3d %4d/%-3d %4d/%-3d %3d/%-3d %9.3g %7.1f\n",
                  hidden.c_str(), n, group.first, n, group.exact, n, group.relation, n,
                  group.within, group.parameters, group.covered, group.parameters,
                  median(group.chi2), median(group.seconds));
    text += line;
  }
  return text;
}

std::string confusion_text(std::span<const Grade> grades) {
  std::string text = "\nHidden -> reported, where not exact\n";
  std::map<std::pair<std::string, std::string>, std::vector<std::string>> confusion;
  for (const Grade& g : grades) {
    if (!g.exact) confusion[{row_of(g), column_of(g)}].push_back(g.name);
  }
  if (confusion.empty()) text += "  none\n";
  for (const auto& [pair, names] : confusion) {
    text += "  " + pair.first + " -> " + pair.second + ": " + std::to_string(names.size()) + " (" +
            names.front() + (names.size() > 1 ? ", ..." : "") + ")\n";
  }
  return text;
}

std::string rates_text(std::span<const Grade> grades) {
  std::string text;
  char line[240];
  for (const Tally& tally : tallies_of(grades)) {
    if (tally.count == 0) continue;
    const Rate rate = rate_interval(tally.hits, tally.count);
    std::snprintf(line, sizeof line, "%-46s %4d of %-4d %5.1f %%  (95 %%: %.1f to %.1f)\n",
                  std::string(tally.label).c_str(), tally.hits, tally.count,
                  100.0 * tally.hits / tally.count, 100.0 * rate.low, 100.0 * rate.high);
    text += line;
  }
  return text;
}

}  // namespace

std::string summary_text(std::span<const Grade> grades) {
  std::string text = table_text(grades) + confusion_text(grades) + "\n" + rates_text(grades);
  for (const Grade& g : grades) {
    if (!g.problem.empty()) text += g.name + ": " + g.problem + "\n";
  }
  return text;
}

Json summary_json(std::span<const Grade> grades) {
  Json json;
  json["schema"] = 1;
  json["rates"] = Json::object();
  for (const Tally& tally : tallies_of(grades)) {
    const Rate rate = rate_interval(tally.hits, tally.count);
    json["rates"][std::string(tally.key)] = {
        {"hits", tally.hits}, {"of", tally.count}, {"ci95", Json::array({rate.low, rate.high})}};
  }
  json["cases"] = Json::array();
  const auto or_null = [](const auto& value) { return value ? Json(*value) : Json(nullptr); };
  for (const Grade& g : grades) {
    json["cases"].push_back({{"name", g.name},
                             {"kind", g.kind},
                             {"hidden", g.hidden},
                             {"named", g.named},
                             {"verdict", g.verdict},
                             {"first_right", g.first_right},
                             {"exact", g.exact},
                             {"relation_right", g.relation_right},
                             {"channel_right", or_null(g.channel_right)},
                             {"depends_right", or_null(g.depends_right)},
                             {"overlap", or_null(g.overlap)},
                             {"parameters", g.parameters},
                             {"within_tolerance", g.within_tolerance},
                             {"covered", g.covered},
                             {"chi2_before", or_null(g.chi2_before)},
                             {"chi2_after", or_null(g.chi2_after)},
                             {"validation_before", or_null(g.validation_before)},
                             {"validation_after", or_null(g.validation_after)},
                             {"seconds", g.seconds},
                             {"problem", g.problem}});
  }
  return json;
}

}  // namespace stickslip::concealment
