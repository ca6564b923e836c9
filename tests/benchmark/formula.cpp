// SPDX-License-Identifier: Apache-2.0
// A formula of a model file against the effect of the catalogue with the same equation, within one
// run. Counters: `term`, time of the term alone over that of the built-in one; `step`, time of a
// step of the rig over that with the built-in one. Below 3 is wanted, for plain numbers and for
// numbers with derivatives.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <map>
#include <string>

#include "physics/catalogue.h"
#include "physics/formula_effect.h"
#include "physics/rig.h"
#include "tests/unit/physics/rigs.h"

namespace stickslip::physics {
namespace {

struct Pair {
  Term formula;
  Term built_in;
};

Pair pair_of(const std::string& text, const std::string& parameter, const std::string& id,
             const std::string& built_in_parameter, double value) {
  FormulaDeclaration declaration{.id = "mine",
                                 .quantity = FormulaQuantity::force,
                                 .channel = {},
                                 .text = text,
                                 .parameters = {{parameter, ""}},
                                 .states = {}};
  Pair out;
  out.formula.id = declaration.id;
  out.formula.parameters[parameter] = {value};
  out.formula.formula = FormulaEffect::make(declaration, out.formula.parameters, {});
  out.built_in.id = id;
  out.built_in.parameters[built_in_parameter] = {value};
  return out;
}

// Seconds per call: the best of several rounds.
template <class Run>
double seconds_of(Run run) {
  using Clock = std::chrono::steady_clock;
  constexpr int calls = 20000;
  double best = 1.0e9;
  for (int round = 0; round < 7; ++round) {
    const auto begin = Clock::now();
    for (int k = 0; k < calls; ++k) run(k);
    best = std::min(best, std::chrono::duration<double>(Clock::now() - begin).count() / calls);
  }
  return best;
}

template <class T>
double term_seconds(const Term& term) {
  const Effect& effect = *effect_of(term);
  OperatingPoint<T> at;
  const std::array<T, 1> p = {T(0.3)};
  const T s(0.0);
  return seconds_of([&](int k) {
    at.x = T(1.0e-6 * k);
    at.v = T(0.1 + 1.0e-6 * k);
    benchmark::DoNotOptimize(effect.force(at, p.data(), &s));
  });
}

template <class T>
double step_seconds(const Term& term) {
  Model model = test::bench();
  model.terms.push_back(term);
  const Rig rig(model);
  const std::vector<T> values(rig.parameter_values().begin(), rig.parameter_values().end());
  const auto n = rig.numbers<T>(std::span<const T>(values));
  RigState<T> state;
  Input input;
  input.base_acceleration_m_s2 = 2.0;
  rig.complete(state, input, 0.0, n);
  return seconds_of([&](int k) {
    rig.step(state, input, input, 2.5e-4 * k, 2.5e-4, n);
    benchmark::DoNotOptimize(state);
  });
}

template <class T>
void compare(benchmark::State& state, const Pair& pair) {
  for ([[maybe_unused]] auto _ : state) {
    state.counters["term"] = term_seconds<T>(pair.formula) / term_seconds<T>(pair.built_in);
    state.counters["step"] = step_seconds<T>(pair.formula) / step_seconds<T>(pair.built_in);
    state.counters["term_ns"] = 1.0e9 * term_seconds<T>(pair.formula);
    state.counters["step_ns"] = 1.0e9 * step_seconds<T>(pair.formula);
  }
}

[[maybe_unused]] const bool registered = [] {
  const std::map<std::string, Pair> pairs = {
      {"quadratic_drag", pair_of("c*v*abs(v)", "c", "quadratic_drag", "drag_n_s2_m2", 0.3)},
      {"cubic_stiffness", pair_of("k*x^3", "k", "cubic_stiffness", "k3_n_m3", 7.0e3)}};
  for (const auto& [name, pair] : pairs) {
    benchmark::RegisterBenchmark((name + "/plain").c_str(), compare<double>, pair)->Iterations(1);
    benchmark::RegisterBenchmark((name + "/derivatives").c_str(), compare<Dual>, pair)
        ->Iterations(1);
  }
  return true;
}();

}  // namespace
}  // namespace stickslip::physics

BENCHMARK_MAIN();
