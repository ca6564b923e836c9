#include "diagnosis/fitting.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "diagnosis/median.h"
#include "diagnosis/score.h"

namespace stickslip::diagnosis {

namespace {

// Leading share of each window in the first stage of a fit.
constexpr double first_stage_share = 0.35;

// True if `is(experiment, channel)` for any compared channel of any recording.
template <class Is>
bool any_compared(std::span<const Experiment> experiments, Is&& is) {
  for (const Experiment& e : experiments) {
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      if (e.is_compared(c) && is(e, c)) return true;
    }
  }
  return false;
}

bool noise_is_declared(std::span<const Experiment> experiments) {
  return !any_compared(experiments,
                       [](const Experiment& e, std::size_t c) { return !e.noise_declared[c]; });
}

bool noise_is_assumed(std::span<const Experiment> experiments) {
  return any_compared(experiments,
                      [](const Experiment& e, std::size_t c) { return e.noise_assumed[c]; });
}

using ByChannel = std::array<std::vector<double>, predicted_channels>;

// Adds the mean square residual of every channel in one window.
void add_mean_squares(const Task& task, std::size_t w, const Readings& readings, ByChannel& out) {
  const Experiment& e = task.experiment(w);
  const Window& window = task.window(w);
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    double sum = 0.0;
    double samples = 0.0;
    for (std::size_t k = window.begin; k < window.end; ++k) {
      if (!e.is_compared(k, c)) continue;
      const double error = readings[k - window.begin][c] - e.reading[k][c];
      sum += error * error;
      samples += 1.0;
    }
    if (samples > 0.0 && std::isfinite(sum)) out[c].push_back(sum / samples);
  }
}

// Weighs channels without declared noise by their residuals in the median window: a wrong estimate
// of the noise then does not decide between channels, and windows that the hypothesis cannot follow
// do not bias its parameters.
void reweight(Task& task, const Hypothesis& hypothesis, const Fit& fitted) {
  ByChannel mean_square;
  for (std::size_t w = 0; w < task.windows.size(); ++w) {
    const Window& window = task.window(w);
    const auto readings =
        predict(task.experiment(w), window, window.end, hypothesis, fitted.z, fitted.state[w]);
    add_mean_squares(task, w, readings, mean_square);
  }
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    const bool declared = std::any_of(task.experiments.begin(), task.experiments.end(),
                                      [c](const Experiment& e) { return e.noise_declared[c]; });
    if (declared || mean_square[c].empty()) continue;
    task.sigma[c] =
        std::max(noise_sigma(task.experiments)[c], std::sqrt(median(std::move(mean_square[c]))));
  }
}

// Close to the estimated noise the residuals are no longer a better estimate of it: the last steps
// weigh the channels by the noise itself.
void refit_at_noise(const SearchData& data, Task& task, FittedCandidate& each,
                    const FitOptions& options) {
  const auto noise = noise_sigma(data.experiments);
  bool changed = false;
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (task.sigma[c] > data.criteria.near_noise_factor * noise[c]) return;
    changed = changed || task.sigma[c] > noise[c];
  }
  if (!changed) return;
  task.sigma = noise;
  each.fitted = fit(task, *each.hypothesis, each.fitted.z, each.fitted.state, options);
}

void converge(const SearchData& data, FittedCandidate& each) {
  Task task = data.train;
  each.hypothesis = each.hypothesis->refined();
  each.fitted.z.resize(each.hypothesis->unknowns().size(), 0.0);
  reweight(task, *each.hypothesis, each.fitted);
  FitOptions options;
  options.tolerance = 1.0e-3;
  options.iterations = 8;
  each.fitted = fit(task, *each.hypothesis, each.fitted.z, each.fitted.state, options);
  options.multistart = false;
  refit_at_noise(data, task, each, options);
}

// The hypothesis of a candidate around the fitted sizes of its effects, without refinements.
Hypothesis unrefined(const Hypothesis& declared, const FittedCandidate& each) {
  const auto found = each.hypothesis->parameters(each.fitted.z);
  const auto& initial = each.hypothesis->rig().parameter_values();
  Hypothesis out = declared;
  for (const physics::BoundTerm& term : each.hypothesis->trial_terms()) {
    std::vector<double> values = values_of(term, found);
    const std::vector<double> fixed = values_of(term, initial);
    const auto& cards = term.effect->card().parameters;
    for (std::size_t k = 0; k < cards.size(); ++k) {
      if (cards[k].fixed_default) values[k] = fixed[k];
    }
    out = out.with(*term.effect, term.place, values, {}, Detail::coarse);
  }
  return out;
}

}  // namespace

SearchData search_data(std::span<const Experiment> experiments, std::span<const Experiment> coarse,
                       const Criteria& criteria, std::uint64_t seed, int threads) {
  return {experiments,
          coarse,
          criteria,
          seed,
          threads,
          noise_is_declared(experiments),
          task_for(experiments, false, threads),
          task_for(experiments, true, threads)};
}

Task task_for(std::span<const Experiment> experiments, bool held_out, int threads) {
  Task task;
  task.experiments = experiments;
  task.sigma = noise_sigma(experiments);
  task.threads = threads;
  for (std::size_t i = 0; i < experiments.size(); ++i) {
    for (std::size_t w = 0; w < experiments[i].windows.size(); ++w) {
      if (experiments[i].windows[w].held_out == held_out) task.windows.push_back({i, w});
    }
  }
  return task;
}

FitOptions brief_fit(int iterations) {
  FitOptions options;
  options.iterations = iterations;
  options.tolerance = 1.0e-2;
  options.multistart = false;
  options.covariance = false;
  return options;
}

Fit fit_in_stages(const Task& task, const Hypothesis& hypothesis, const std::vector<double>& z,
                  const std::vector<WindowState>& states, const FitOptions& options) {
  Task beginning = task;
  beginning.share = first_stage_share;
  const Fit first = fit(beginning, hypothesis, z, states, brief_fit(3));
  return fit(task, hypothesis, first.z, first.state, options);
}

FittedCandidate calibrate(SearchData& data, const physics::Model& model) {
  FittedCandidate out;
  out.hypothesis.emplace(model);
  const std::vector<double> origin(out.hypothesis->unknowns().size(), 0.0);
  out.fitted = fit_in_stages(data.train, *out.hypothesis, origin,
                             initial_states(data.train, *out.hypothesis), {});
  settle(data, out);
  return out;
}

void settle(SearchData& data, FittedCandidate& each) {
  reweight(data.train, *each.hypothesis, each.fitted);
  each.fitted = fit(data.train, *each.hypothesis, each.fitted.z, each.fitted.state);
  refit_at_noise(data, data.train, each, {});
  const auto score = [&] {
    return held_out_score(data.held_out, *each.hypothesis, each.fitted.z, data.noise_is_known);
  };
  each.held_out = score();
  // A model that follows half of the windows down to the estimated noise confirms the estimate:
  // anything but noise would leave more.
  if (!data.noise_is_known && !noise_is_assumed(data.experiments) &&
      std::abs(std::log(each.held_out.typical_chi2)) < data.criteria.confirmed_noise_log) {
    data.noise_is_known = true;
    each.held_out = score();
  }
}

void fit_thoroughly(const SearchData& data, std::span<FittedCandidate> candidates) {
  double min_cost = std::numeric_limits<double>::infinity();
  for (FittedCandidate& each : candidates) {
    each.fitted = fit(data.train, *each.hypothesis, each.fitted.z, each.fitted.state, brief_fit(4));
    // A fit closer than the noise is not a better one.
    const double samples = std::accumulate(each.fitted.count.begin(), each.fitted.count.end(), 0.0);
    min_cost = std::min(min_cost, std::max(each.fitted.cost, samples));
  }
  for (FittedCandidate& each : candidates) {
    if (each.fitted.cost <= data.criteria.hopeless_cost_ratio * min_cost) converge(data, each);
  }
}

void fit_and_score(const SearchData& data, const HeldOut& current,
                   std::span<FittedCandidate> candidates) {
  fit_thoroughly(data, candidates);
  for (FittedCandidate& each : candidates) {
    each.held_out =
        held_out_score(data.held_out, *each.hypothesis, each.fitted.z, data.noise_is_known);
    each.gain_z = gain_z(current, each.held_out);
  }
}

void restart_best(const SearchData& data, const Hypothesis& declared, const HeldOut& current,
                  std::span<FittedCandidate> candidates) {
  const auto is_near_noise = [&](const FittedCandidate& each) {
    return each.held_out.chi2 < data.criteria.restart_chi2;
  };
  if (std::any_of(candidates.begin(), candidates.end(), is_near_noise)) return;
  std::vector<FittedCandidate*> best;
  for (FittedCandidate& each : candidates) {
    // The cost of a drawn shape has no local minima of its own.
    if (tier_of(each.candidate) != physics::Tier::free_form) best.push_back(&each);
  }
  std::stable_sort(best.begin(), best.end(),
                   [](const FittedCandidate* a, const FittedCandidate* b) {
                     return a->total_loss() < b->total_loss();
                   });
  const std::size_t count = std::min(best.size(), data.criteria.effort.restarts);
  for (FittedCandidate* each : std::span(best).first(count)) {
    FittedCandidate fresh = *each;
    fresh.hypothesis = unrefined(declared, *each);
    const Hypothesis& hypothesis = *fresh.hypothesis;
    fresh.fitted = fit_in_stages(
        data.train, hypothesis, std::vector<double>(hypothesis.unknowns().size(), 0.0),
        initial_states(data.train, hypothesis), brief_fit(data.criteria.effort.rough_iterations));
    fit_and_score(data, current, {&fresh, 1});
    if (fresh.total_loss() < each->total_loss()) *each = std::move(fresh);
  }
}

}  // namespace stickslip::diagnosis
