// Detection rate, classification and false alarms of the model check over many seeded rigs. Prints
// a table; the latest one is in docs/observer.md.
//
//   model_check_campaign [--seeds N] [--first SEED] [--null-hours H] [--days D]
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "observer/explanation.h"
#include "tests/unit/observer/model_check_run.h"

namespace stickslip::observer::test {
namespace {

struct Options {
  std::uint64_t seeds = 100;
  std::uint64_t first = 1000;  ///< differs from the seeds that the thresholds were tuned with
  double null_hours = 1.0;
  double days = 30.0;
};

void detect(Change change, const Options& options) {
  std::uint64_t detected = 0, classified = 0, explained = 0, early = 0;
  std::vector<double> after_s;
  for (std::uint64_t seed = options.first; seed < options.first + options.seeds; ++seed) {
    const Scenario scenario = make_sliding_scenario(seed, change == Change::load_cell);
    std::mt19937_64 random(seed);
    const double change_s = std::uniform_real_distribution<double>(20.0, 35.0)(random);
    std::vector<Frame> frames;
    const Outcome outcome =
        run_check(scenario, change, change_s, 10.0, seed, {options.days}, &frames);
    early += outcome.alarms_before > 0 ? 1 : 0;
    if (!outcome.after_s) continue;
    ++detected;
    after_s.push_back(*outcome.after_s);
    classified += is_right(change, outcome.verdict) ? 1 : 0;
    const auto explanations = explanations_of(scenario.assumed, period_s, frames, outcome.verdict);
    explained += !explanations.empty() && is_right(change, explanations.front()) ? 1 : 0;
  }
  std::sort(after_s.begin(), after_s.end());
  const auto quantile = [&](double share) {
    if (after_s.empty()) return 0.0;
    return after_s[static_cast<std::size_t>(share * static_cast<double>(after_s.size() - 1))];
  };
  std::printf(
      "%-26s %4llu runs: detected in 10 s %4llu, classified correctly %4llu, "
      "explained correctly %4llu, early alarms %llu; "
      "median %.1f s, 95 %% %.1f s\n",
      std::string(name_of(change)).c_str(), static_cast<unsigned long long>(options.seeds),
      static_cast<unsigned long long>(detected), static_cast<unsigned long long>(classified),
      static_cast<unsigned long long>(explained), static_cast<unsigned long long>(early),
      quantile(0.5), quantile(0.95));
  std::fflush(stdout);
}

void count_false_alarms(const Options& options) {
  constexpr double run_s = 240.0;
  const auto runs = static_cast<std::uint64_t>(std::ceil(options.null_hours * 3600.0 / run_s));
  std::uint64_t alarms = 0;
  for (std::uint64_t seed = options.first; seed < options.first + runs; ++seed) {
    const Outcome outcome =
        run_check(make_scenario(seed), Change::none, 0.0, run_s, seed, {options.days});
    alarms += outcome.alarms_before;
  }
  std::printf("no change: %llu false alarms in %.2f h of rig time (%llu rigs)\n",
              static_cast<unsigned long long>(alarms), static_cast<double>(runs) * run_s / 3600.0,
              static_cast<unsigned long long>(runs));
}

}  // namespace
}  // namespace stickslip::observer::test

int main(int argc, char** argv) {
  using namespace stickslip::observer::test;
  Options options;
  CLI::App app("Detection rate, classification and false alarms of the model check.");
  app.add_option("--seeds", options.seeds, "runs of each change")->capture_default_str();
  app.add_option("--first", options.first, "first seed")->capture_default_str();
  app.add_option("--null-hours", options.null_hours, "rig time without a change [h]")
      ->capture_default_str();
  app.add_option("--days", options.days, "days between false alarms")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  for (const Change change : changes) detect(change, options);
  count_false_alarms(options);
  return 0;
}
