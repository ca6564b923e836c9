// SPDX-License-Identifier: Apache-2.0
// Quality of the observer on concealed recordings of all worlds, as tables in Markdown: filter and
// smoother next to the best estimates by hand, against a simulator that shares nothing with the
// observer's. docs/observer.md, "Quality", holds the latest.
//
//   observer_table [--count N] [--seed S] [--duration T] [--kind null|single|sound]
//                  [--document FILE] [--csv FILE] [--jobs N]
//
// `null`: nothing is hidden. `sound`: the same, false alarms of the live check only. `single`: one
// effect of the catalogue is present from the beginning; alarms and explanations of the live check.
// Exit status 1 where the results contradict themselves.
#include <CLI/CLI.hpp>
#include <atomic>
#include <cstdio>
#include <exception>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "diagnosis/parallel/for_each.h"
#include "tests/benchmark/observer_quality.h"
#include "tests/benchmark/quality_table.h"
#include "tools/concealment/concealment.h"

namespace stickslip {
namespace {

using quality::RecordingQuality;

struct Options {
  std::size_t count = 60;
  std::uint64_t seed = 1;
  double duration_s = 60.0;
  std::string kind = "null";
  std::string document;
  std::string csv;
  int jobs = 0;
};

// Recording i of the campaign depends on the seed and i only.
RecordingQuality evaluated(const Options& options, std::size_t i) {
  using Kind = concealment::CaseRequest::Kind;
  const bool single = options.kind == "single";
  concealment::CaseRequest request;
  request.kind = single ? Kind::single : Kind::nothing;
  request.duration_s = options.duration_s;
  const concealment::Case recorded = concealment::conceal(
      request, options.seed + i, options.kind + " " + std::to_string(options.seed + i));
  if (options.kind == "null") return quality::quality_of(recorded);
  return single ? quality::live_check_of(recorded) : quality::false_alarms_of(recorded);
}

bool is_share(const std::optional<double>& value) {
  return !value || (*value >= 0.0 && *value <= 1.0);
}

// Contradiction to a property of every observer; empty: none.
std::string contradiction_in(const RecordingQuality& each, bool null) {
  if (each.world.empty() || !(each.duration_s > 0.0)) return "was not evaluated";
  if (!each.unsupported.empty()) return "";
  if (!null) return "";
  const auto& [causal, best] = each.by_hand;
  const auto worse = [](const std::optional<double>& one, const std::optional<double>& other) {
    return one.has_value() != other.has_value() || (one && *one > *other);
  };
  if (worse(best.force, causal.force) || worse(best.theta, causal.theta) ||
      worse(best.slip, causal.slip)) {
    return "has a best estimate by hand that is worse than the causal one";
  }
  for (const auto* estimator : {&each.filter, &each.smoother}) {
    if (!estimator->slip) return "has no good frame";
    for (const auto* value :
         {&estimator->auc, &estimator->force_coverage, &estimator->theta_coverage,
          &estimator->slip_coverage, &estimator->mu_coverage, &estimator->load_coverage,
          &estimator->nees_inside}) {
      if (!is_share(*value)) return "has a share beyond 0 to 1";
    }
    if (!is_share(estimator->good_share)) return "has more good frames than frames";
  }
  return "";
}

std::string content_of(const std::string& file) {
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), {}};
}

int run(const Options& options) {
  const std::string& document = options.document;
  // Before the work: the document has its marks.
  if (!document.empty()) quality::renewed(content_of(document), options.kind, "");
  std::vector<RecordingQuality> recordings(options.count);
  std::atomic<std::size_t> done = 0;
  parallel::for_each(options.count, parallel::threads_for(options.jobs), [&](std::size_t i) {
    recordings[i] = evaluated(options, i);
    std::fprintf(stderr, "%zu of %zu: %s, %s\n", done.fetch_add(1) + 1, options.count,
                 recordings[i].name.c_str(), recordings[i].world.c_str());
  });
  const bool null = options.kind == "null";
  const std::string text = null                      ? quality_tables(recordings)
                           : options.kind == "sound" ? false_alarm_table(recordings)
                                                     : live_check_table(recordings);
  std::fwrite(text.data(), 1, text.size(), stdout);
  if (!document.empty()) {
    const std::string renewed = quality::renewed(content_of(document), options.kind, text);
    std::ofstream(document) << renewed;
  }
  if (!options.csv.empty()) std::ofstream(options.csv) << rows_of(recordings);
  int status = 0;
  for (const RecordingQuality& each : recordings) {
    const std::string contradiction = contradiction_in(each, null);
    if (contradiction.empty()) continue;
    std::fprintf(stderr, "%s (%s) %s\n", each.name.c_str(), each.world.c_str(),
                 contradiction.c_str());
    status = 1;
  }
  return status;
}

}  // namespace
}  // namespace stickslip

int main(int argc, char** argv) {
  stickslip::Options options;
  CLI::App app("Quality of the observer on concealed recordings, as tables in Markdown.");
  app.add_option("--count", options.count, "recordings")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--seed", options.seed, "of the first recording")->capture_default_str();
  app.add_option("--duration", options.duration_s, "least duration of a recording [s]")
      ->check(CLI::Range(5.0, 3600.0))
      ->capture_default_str();
  app.add_option("--kind", options.kind,
                 "null: nothing is hidden; sound: likewise, live check only; single: one effect is")
      ->check(CLI::IsMember({"null", "sound", "single"}))
      ->capture_default_str();
  app.add_option("--document", options.document, "Markdown file whose tables are renewed")
      ->check(CLI::ExistingFile);
  app.add_option("--csv", options.csv, "file for one row per recording");
  app.add_option("--jobs", options.jobs, "threads; 0: one per core")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    return stickslip::run(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
