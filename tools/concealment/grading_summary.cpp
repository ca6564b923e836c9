// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "physics/number_text.h"
#include "tools/concealment/grading.h"

namespace stickslip::concealment {

using Json = nlohmann::ordered_json;

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

// A rate of the summary: what it counts of a grade.
struct Criterion {
  std::string_view key;  ///< in the JSON
  std::string_view label;
  void (*count)(const Grade&, Tally&);
};

bool hides_something(const Grade& g) { return g.kind != "null"; }

const std::array criteria = {
    Criterion{"single effects named right first", "single effects: first finding correct",
              [](const Grade& g, Tally& t) {
                if (g.kind == "single") t.add(g.first_right);
              }},
    Criterion{"single effects exact (nothing more)", "single effects: exact",
              [](const Grade& g, Tally& t) {
                if (g.kind == "single") t.add(g.exact);
              }},
    Criterion{"relation right", "relation correct",
              [](const Grade& g, Tally& t) {
                if (hides_something(g)) t.add(g.relation_right);
              }},
    Criterion{"nothing hidden called consistent", "no hidden effect: consistent",
              [](const Grade& g, Tally& t) {
                if (!hides_something(g)) t.add(!g.false_alarm && g.verdict_right);
              }},
    Criterion{"both of two named, nothing more", "two effects: both found, no surplus",
              [](const Grade& g, Tally& t) {
                if (g.kind == "pair") t.add(g.exact);
              }},
    Criterion{"all of three named, nothing more", "three effects: all found, no surplus",
              [](const Grade& g, Tally& t) {
                if (g.kind == "triple") t.add(g.exact);
              }},
    Criterion{"at least two of three named", "three effects: at least two found",
              [](const Grade& g, Tally& t) {
                if (g.kind == "triple") t.add(g.found >= 2);
              }},
    Criterion{"unlisted physics called so", "unlisted physics: reported as unlisted",
              [](const Grade& g, Tally& t) {
                if (g.kind == "unlisted") t.add(g.first_right);
              }},
    Criterion{"unlisted physics at the right relation", "unlisted physics: relation correct",
              [](const Grade& g, Tally& t) {
                if (g.kind == "unlisted") t.add(g.relation_right);
              }},
    Criterion{"unlisted physics given a wrong name", "unlisted physics: wrong effect reported",
              [](const Grade& g, Tally& t) {
                if (g.kind == "unlisted") t.add(!g.first_right && !g.named.empty());
              }},
    Criterion{"channel right", "channel correct",
              [](const Grade& g, Tally& t) { t.add(g.channel_right); }},
    Criterion{"parameters within 10 %", "parameters within 10 %",
              [](const Grade& g, Tally& t) { t.add(g.within_tenth, g.parameters); }},
    Criterion{"parameters within their tolerance", "parameters within tolerance",
              [](const Grade& g, Tally& t) { t.add(g.within_tolerance, g.parameters); }},
    Criterion{"95 % intervals that hold the truth", "coverage of the 95 % intervals",
              [](const Grade& g, Tally& t) { t.add(g.covered, g.parameters); }},
    Criterion{"events found with an overlap above 0.8", "events: overlap above 0.8",
              [](const Grade& g, Tally& t) {
                if (g.overlap) t.add(*g.overlap > 0.8);
              }},
    Criterion{"held-out chi-squared at most 1.15 where named",
              "exact reports: held-out chi-squared <= 1.15",
              [](const Grade& g, Tally& t) {
                if (hides_something(g) && g.exact && g.chi2_after) t.add(*g.chi2_after <= 1.15);
              }},
    Criterion{"better on another run", "validation run predicted better",
              [](const Grade& g, Tally& t) { t.add(improved(g)); }},
};

std::vector<Tally> tallies_of(std::span<const Grade> grades) {
  std::vector<Tally> tallies;
  for (const Criterion& criterion : criteria) {
    Tally& tally = tallies.emplace_back(Tally{criterion.key, criterion.label});
    for (const Grade& g : grades) criterion.count(g, tally);
  }
  return tallies;
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
    groups[g.kind == "pair"     ? "(two effects)"
           : g.kind == "triple" ? "(three effects)"
                                : row_of(g)]
        .add(g);
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

// How well reports do with one imperfection of the instruments, or without any.
struct NuisanceRow {
  std::string name;
  int cases = 0;
  Tally accused{};  ///< reports of cases without a hidden effect that find one
  Tally first{};    ///< single effects
  Tally exact{};
  void add(const Grade& g) {
    ++cases;
    if (g.kind == "null" && !g.verdict.empty()) accused.add(g.false_alarm);
    if (g.kind != "single") return;
    first.add(g.first_right);
    exact.add(g.exact);
  }
};

// By name, then one alone, several, and ideal instruments; empty if all instruments are ideal. A
// case with three nuisances stands in three rows.
std::vector<NuisanceRow> nuisance_rows(std::span<const Grade> grades) {
  std::map<std::string, NuisanceRow> named;
  NuisanceRow alone{"(one alone)"};
  NuisanceRow several{"(several)"};
  NuisanceRow ideal{"(ideal)"};
  for (const Grade& g : grades) {
    for (const std::string& nuisance : g.nuisances) named[nuisance].add(g);
    (g.nuisances.empty() ? ideal : g.nuisances.size() == 1 ? alone : several).add(g);
  }
  std::vector<NuisanceRow> rows;
  for (auto& [name, row] : named) {
    row.name = name;
    rows.push_back(row);
  }
  if (rows.empty()) return rows;
  for (const NuisanceRow& row : {alone, several, ideal}) rows.push_back(row);
  return rows;
}

std::string share_text(const Tally& tally) {
  return std::to_string(tally.hits) + "/" + std::to_string(tally.count);
}

std::string nuisance_text(std::span<const Grade> grades) {
  const std::vector<NuisanceRow> rows = nuisance_rows(grades);
  if (rows.empty()) return "";
  char line[200];
  std::snprintf(line, sizeof line, "\n%-12s %4s %13s %13s %13s\n", "instruments", "n",
                "nulls accused", "singles first", "exact");
  std::string text = line;
  for (const NuisanceRow& row : rows) {
    std::snprintf(line, sizeof line, "%-12s %4d %13s %13s %13s\n", row.name.c_str(), row.cases,
                  share_text(row.accused).c_str(), share_text(row.first).c_str(),
                  share_text(row.exact).c_str());
    text += line;
  }
  return text;
}

Json nuisance_json(std::span<const Grade> grades) {
  Json json = Json::array();
  for (const NuisanceRow& row : nuisance_rows(grades)) {
    json.push_back({{"nuisance", row.name},
                    {"cases", row.cases},
                    {"nulls", row.accused.count},
                    {"nulls_accused", row.accused.hits},
                    {"singles", row.first.count},
                    {"singles_named_first", row.first.hits},
                    {"singles_exact", row.exact.hits}});
  }
  return json;
}

// Single effects of a size over the noise from `low` to `high`.
struct SizeBin {
  double low;
  double high;
  Tally first{};
};

// The detection curve: bins that hold effects.
std::vector<SizeBin> detection_curve(std::span<const Grade> grades) {
  constexpr double no_limit = std::numeric_limits<double>::infinity();
  constexpr std::array edges = {0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, no_limit};
  std::vector<SizeBin> bins;
  for (std::size_t i = 0; i + 1 < edges.size(); ++i) {
    SizeBin bin{edges[i], edges[i + 1], {}};
    for (const Grade& g : grades) {
      if (g.snr && *g.snr >= bin.low && *g.snr < bin.high) bin.first.add(g.first_right);
    }
    if (bin.first.count > 0) bins.push_back(bin);
  }
  return bins;
}

std::string detection_text(std::span<const Grade> grades) {
  const std::vector<SizeBin> bins = detection_curve(grades);
  if (bins.empty()) return "";
  std::string text = "\nSize over the noise, single effects named first\n";
  char line[120];
  for (const SizeBin& bin : bins) {
    std::string range = physics::number_text(bin.low);
    range += std::isfinite(bin.high) ? " to " + physics::number_text(bin.high) : " or more";
    std::snprintf(line, sizeof line, "  %-12s %7s\n", range.c_str(), share_text(bin.first).c_str());
    text += line;
  }
  return text;
}

Json detection_json(std::span<const Grade> grades) {
  Json json = Json::array();
  for (const SizeBin& bin : detection_curve(grades)) {
    json.push_back({{"snr_from", bin.low},
                    {"snr_to", std::isfinite(bin.high) ? Json(bin.high) : Json(nullptr)},
                    {"singles", bin.first.count},
                    {"singles_named_first", bin.first.hits}});
  }
  return json;
}

// Studies of sealed rigs whose physics the first run left open, and of all.
struct StudyRow {
  std::string_view name;
  Tally first{};
  Tally exact{};
  std::vector<double> runs{}, rig_time_s{};
  double used_share = 0.0;
  void add(const Grade& g) {
    first.add(g.first_right);
    exact.add(g.exact);
    runs.push_back(g.study->runs);
    rig_time_s.push_back(g.study->rig_time_s);
    used_share = std::max(used_share, g.study->used_share);
  }
};

std::vector<StudyRow> study_rows(std::span<const Grade> grades) {
  StudyRow open{"open after one"};
  StudyRow all{"all"};
  for (const Grade& g : grades) {
    if (!g.study) continue;
    all.add(g);
    if (g.study->open_after_first) open.add(g);
  }
  if (all.runs.empty()) return {};
  return {std::move(open), std::move(all)};
}

std::string study_text(std::span<const Grade> grades) {
  const std::vector<StudyRow> rows = study_rows(grades);
  if (rows.empty()) return "";
  char line[200];
  std::snprintf(line, sizeof line, "\n%-15s %4s %7s %7s %5s %10s %11s\n", "sealed rigs", "n",
                "first", "exact", "runs", "rig time s", "of limits");
  std::string text = line;
  for (const StudyRow& row : rows) {
    std::snprintf(line, sizeof line, "%-15s %4zu %7s %7s %5.3g %10.4g %9.0f %%\n",
                  std::string(row.name).c_str(), row.runs.size(), share_text(row.first).c_str(),
                  share_text(row.exact).c_str(), median(row.runs), median(row.rig_time_s),
                  100.0 * row.used_share);
    text += line;
  }
  return text;
}

Json study_json(std::span<const Grade> grades) {
  Json json = Json::array();
  for (const StudyRow& row : study_rows(grades)) {
    json.push_back({{"rigs", row.name},
                    {"studies", row.runs.size()},
                    {"named_first", row.first.hits},
                    {"exact", row.exact.hits},
                    {"median_runs", median(row.runs)},
                    {"median_rig_time_s", median(row.rig_time_s)},
                    {"largest_share_of_limits", row.used_share}});
  }
  return json;
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
  std::string text = table_text(grades) + confusion_text(grades) + nuisance_text(grades) +
                     detection_text(grades) + study_text(grades) + "\n" + rates_text(grades);
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
  json["by_nuisance"] = nuisance_json(grades);
  json["by_snr"] = detection_json(grades);
  json["studies"] = study_json(grades);
  json["cases"] = Json::array();
  const auto or_null = [](const auto& value) { return value ? Json(*value) : Json(nullptr); };
  for (const Grade& g : grades) {
    json["cases"].push_back(
        {{"name", g.name},
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
         {"found", g.found},
         {"nuisances", g.nuisances},
         {"snr", or_null(g.snr)},
         {"parameters", g.parameters},
         {"within_tolerance", g.within_tolerance},
         {"covered", g.covered},
         {"chi2_before", or_null(g.chi2_before)},
         {"chi2_after", or_null(g.chi2_after)},
         {"validation_before", or_null(g.validation_before)},
         {"validation_after", or_null(g.validation_after)},
         {"study", g.study ? Json{{"runs", g.study->runs},
                                  {"rig_time_s", g.study->rig_time_s},
                                  {"used_share", g.study->used_share},
                                  {"open_after_first", g.study->open_after_first}}
                           : Json(nullptr)},
         {"seconds", g.seconds},
         {"problem", g.problem}});
  }
  return json;
}

}  // namespace stickslip::concealment
