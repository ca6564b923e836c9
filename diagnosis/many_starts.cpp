// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/many_starts.h"

#include <algorithm>
#include <array>
#include <random>
#include <utility>

namespace stickslip::diagnosis {

namespace {

// Medians of the eighths of a normal distribution: each number takes all of them, in a start each.
constexpr std::array<double, 8> deviates = {-1.534, -0.887, -0.489, -0.157,
                                            0.157,  0.489,  0.887,  1.534};
// Leading shares of the windows. About half of the starts go on from each.
constexpr std::array<double, 4> growing_share = {0.06, 0.13, 0.3, 0.65};

// `z`, and a Latin hypercube of the declared numbers around it (McKay, Beckman and Conover 1979).
std::vector<std::vector<double>> spread_starts(const Hypothesis& hypothesis,
                                               const std::vector<double>& z, std::uint64_t seed) {
  std::vector<std::vector<double>> out(1 + deviates.size(), z);
  std::mt19937_64 random(seed);
  bool any = false;
  for (std::size_t u = 0; u < z.size(); ++u) {
    const Unknown& unknown = hypothesis.unknowns()[u];
    if (!unknown.of_model || !(unknown.prior_sigma > 0.0)) continue;
    any = true;
    auto shuffled = deviates;
    std::shuffle(shuffled.begin(), shuffled.end(), random);
    for (std::size_t i = 0; i < shuffled.size(); ++i) {
      out[1 + i][u] += unknown.prior_sigma * shuffled[i];
    }
  }
  if (!any) out.resize(1);
  return out;
}

void keep_better_half(std::vector<Fit>& fits) {
  std::stable_sort(fits.begin(), fits.end(),
                   [](const Fit& a, const Fit& b) { return a.cost < b.cost; });
  fits.resize((fits.size() + 1) / 2);
}

// Fits the beginnings of the windows, which grow as the worse half of the runners drops out each
// time, and with `options` the best of them to whole windows, with the instruments free again.
Fit fit_of_winner(const Task& task, const Hypothesis& hypothesis, const Hypothesis& held,
                  std::vector<Fit> runners, const FitOptions& options) {
  Task beginning = task;
  beginning.steps = Steps::coarse;
  for (const double share : growing_share) {
    beginning.share = share;
    for (Fit& each : runners) {
      each = fit(beginning, held, std::move(each.z), std::move(each.state), brief_fit(3));
    }
    keep_better_half(runners);
  }
  return fit(task, hypothesis, carried_over(held, runners.front().z, hypothesis),
             std::move(runners.front().state), options);
}

}  // namespace

Hypothesis holding_instruments(const Hypothesis& hypothesis) {
  const std::vector<double> beyond_any(hypothesis.unknowns().size(), 1.0);
  return hypothesis.holding(hypothesis.instruments_beyond(beyond_any, 0.0));
}

Fit fit_growing_beginnings(const Task& task, const Hypothesis& hypothesis,
                           const std::vector<double>& z, const std::vector<WindowState>& states,
                           const FitOptions& options) {
  const Hypothesis held = holding_instruments(hypothesis);
  Fit start;
  start.z = carried_over(hypothesis, z, held);
  start.state = states;
  return fit_of_winner(task, hypothesis, held, {std::move(start)}, options);
}

Fit fit_from_many_starts(const Task& task, const Hypothesis& hypothesis,
                         const std::vector<double>& z, const std::vector<WindowState>& states,
                         std::uint64_t seed, const FitOptions& options) {
  const Hypothesis held = holding_instruments(hypothesis);
  std::vector<Fit> runners;
  for (std::vector<double>& start : spread_starts(held, carried_over(hypothesis, z, held), seed)) {
    Fit& next = runners.emplace_back();
    next.z = std::move(start);
    next.state = states;
  }
  return fit_of_winner(task, hypothesis, held, std::move(runners), options);
}

}  // namespace stickslip::diagnosis
