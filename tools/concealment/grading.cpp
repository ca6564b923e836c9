#include "tools/concealment/grading.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>

namespace stickslip::concealment {

namespace {

using concealment::TrueEffect;
using concealment::Truth;
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

// Length of what two sets of spans share, over the length of what either covers.
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

bool holds(const std::vector<std::string>& list, const std::string& word) {
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
    const Json& said = finding->at("parameters").at(name);
    double value = said.at("value").get<double>();
    double low = said.at("ci95").at(0).get<double>();
    double high = said.at("ci95").at(1).get<double>();
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

}  // namespace

Grade grade(const Truth& truth, const Json& report) {
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

  // Every hidden effect takes the finding that names it, of several the one at its channel.
  std::vector<const Json*> match(truth.effects.size(), nullptr);
  std::vector<bool> taken(findings.size(), false);
  for (std::size_t i = 0; i < truth.effects.size(); ++i) {
    const TrueEffect& effect = truth.effects[i];
    std::optional<std::size_t> best;
    for (std::size_t k = 0; k < findings.size(); ++k) {
      if (taken[k] || !holds(effect.accept, out.named[k])) continue;
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
  out.all_named =
      std::all_of(match.begin(), match.end(), [](const Json* m) { return m != nullptr; });
  out.first_right = !out.named.empty() &&
                    std::any_of(truth.effects.begin(), truth.effects.end(),
                                [&](const TrueEffect& e) { return holds(e.accept, out.named[0]); });
  const Json location = report.value("location", Json(nullptr));
  const std::string located = location.is_object() ? text_at(location, "relation") : "";
  out.relation_right = true;
  for (std::size_t i = 0; i < match.size(); ++i) {
    const TrueEffect& effect = truth.effects[i];
    const Json* finding =
        match[i] != nullptr ? match[i] : (findings.empty() ? nullptr : &findings.front());
    const std::string said = finding != nullptr ? text_at(*finding, "relation") : located;
    out.relation_right = out.relation_right && holds(effect.relations, said);
    if (effect.channel) {
      const bool here =
          match[i] != nullptr && text_at(*match[i], "channel") == info(*effect.channel).stem;
      out.channel_right = out.channel_right.value_or(true) && here;
    }
    if (!effect.when_s.empty()) {
      Spans said_when;
      if (match[i] != nullptr && match[i]->contains("when_s")) {
        said_when = spans_of(match[i]->at("when_s"));
      } else if (location.is_object()) {
        said_when = spans_of(location.value("when_s", Json::array()));
      }
      out.overlap = overlap_of(said_when, effect.when_s);
    }
    if (!effect.depends_on.empty()) {
      bool depends = false;
      if (match[i] != nullptr) {
        for (const Json& name : match[i]->at("parameters").value("depends_on", Json::array())) {
          depends = depends || holds(effect.depends_on, name.get<std::string>());
        }
      }
      out.depends_right = depends;
    }
    const bool by_its_id = match[i] != nullptr && text_at(*match[i], "id") == effect.id;
    grade_parameters(out, effect, by_its_id ? match[i] : nullptr);
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

// What is counted, over which grades.
struct Tally {
  std::string_view name;
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
  Tally first{"single effects named right first"};
  Tally exact{"single effects exact (nothing more)"};
  Tally relation{"relation right"};
  Tally null{"nothing hidden called consistent"};
  Tally pairs{"both of two named, nothing more"};
  Tally unlisted{"unlisted physics called so"};
  Tally unlisted_relation{"unlisted physics at the right relation"};
  Tally wrong{"unlisted physics given a wrong name"};
  Tally channel{"channel right"};
  Tally tenth{"parameters within 10 %"};
  Tally within{"parameters within their tolerance"};
  Tally covered{"95 % intervals that hold the truth"};
  Tally when{"events found with an overlap above 0.8"};
  Tally floor{"held-out chi-squared at most 1.15 where named"};
  Tally better{"better on another run"};
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

}  // namespace

std::string summary_text(std::span<const Grade> grades) {
  std::string text;
  char line[240];
  std::map<std::string, std::vector<const Grade*>> by_hidden;
  for (const Grade& g : grades) {
    const std::string row = g.kind == "pair" ? "(two effects)" : row_of(g);
    by_hidden[row].push_back(&g);
  }
  std::snprintf(line, sizeof line, "%-33s %3s %7s %7s %8s %8s %7s %9s %7s\n", "hidden", "n",
                "first", "exact", "relation", "within", "covered", "chi2", "s");
  text += line;
  for (const auto& [hidden, group] : by_hidden) {
    int first = 0;
    int exact = 0;
    int relation = 0;
    int parameters = 0;
    int within = 0;
    int covered = 0;
    std::vector<double> chi2;
    std::vector<double> seconds;
    for (const Grade* g : group) {
      first += g->first_right ? 1 : 0;
      exact += g->exact ? 1 : 0;
      relation += g->relation_right ? 1 : 0;
      parameters += g->parameters;
      within += g->within_tolerance;
      covered += g->covered;
      if (g->chi2_after) chi2.push_back(*g->chi2_after);
      seconds.push_back(g->seconds);
    }
    const int n = static_cast<int>(group.size());
    std::snprintf(line, sizeof line,
                  "%-33s %3d %3d/%-3d %3d/%-3d %4d/%-3d %4d/%-3d %3d/%-3d %9.3g %7.1f\n",
                  hidden.c_str(), n, first, n, exact, n, relation, n, within, parameters, covered,
                  parameters, median(chi2), median(seconds));
    text += line;
  }
  text += "\nHidden -> named, where the two differ\n";
  std::map<std::pair<std::string, std::string>, std::vector<std::string>> confusion;
  for (const Grade& g : grades) {
    if (!g.exact) confusion[{row_of(g), column_of(g)}].push_back(g.name);
  }
  if (confusion.empty()) text += "  nowhere\n";
  for (const auto& [pair, names] : confusion) {
    text += "  " + pair.first + " -> " + pair.second + ": " + std::to_string(names.size()) + " (" +
            names.front() + (names.size() > 1 ? ", ..." : "") + ")\n";
  }
  text += "\n";
  for (const Tally& tally : tallies_of(grades)) {
    if (tally.count == 0) continue;
    const Rate rate = rate_interval(tally.hits, tally.count);
    std::snprintf(line, sizeof line, "%-46s %4d of %-4d %5.1f %%  (95 %%: %.1f to %.1f)\n",
                  std::string(tally.name).c_str(), tally.hits, tally.count,
                  100.0 * tally.hits / tally.count, 100.0 * rate.low, 100.0 * rate.high);
    text += line;
  }
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
    json["rates"][std::string(tally.name)] = {
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
