// SPDX-License-Identifier: Apache-2.0
// Cost of a diagnosis: seconds per fitted hypothesis, speed-up by the second core, and growth with
// the length of the recording, as ratios within one run.
#include <benchmark/benchmark.h>

#include <chrono>

#include "diagnosis/diagnosis.h"
#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

struct Cost {
  double seconds = 0.0;
  double hypotheses = 0.0;  ///< fitted on all windows
};

Cost diagnose_once(const protocol::Recording& recording, int threads) {
  Options options;
  options.threads = threads;
  const auto begin = std::chrono::steady_clock::now();
  const Diagnosis found = diagnose({recording}, test::driven_mass(), options);
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
  return {elapsed.count(), static_cast<double>(found.trials.size())};
}

void diagnosis_of_a_hidden_spring(benchmark::State& state) {
  const auto truth =
      test::with_term(test::driven_mass(), "cubic_stiffness", {{"k3_n_m3", {2.0e4}}});
  const auto once = test::record(truth, 24.0);
  const auto twice = test::record(truth, 48.0);
  Cost one;
  Cost two;
  Cost longer;
  for (auto _ : state) {
    one = diagnose_once(once, 1);
    two = diagnose_once(once, 2);
    longer = diagnose_once(twice, 2);
  }
  state.counters["s_per_hypothesis"] = two.seconds / two.hypotheses;
  state.counters["speedup_2_threads"] = one.seconds / two.seconds;
  state.counters["twice_as_long_costs"] = longer.seconds / two.seconds;
}
BENCHMARK(diagnosis_of_a_hidden_spring)->Unit(benchmark::kSecond)->Iterations(1);

}  // namespace
}  // namespace stickslip::diagnosis

BENCHMARK_MAIN();
