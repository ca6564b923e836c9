// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/fitting.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "diagnosis/many_starts.h"
#include "diagnosis/median.h"
#include "diagnosis/noise_check.h"
#include "diagnosis/noise_estimate.h"
#include "diagnosis/noise_score.h"
#include "diagnosis/score.h"

namespace stickslip::diagnosis {

namespace {

// Leading share of each window in the first stage of a fit.
constexpr double first_stage_share = 0.35;

// Until a step gains less than about a tenth of a nat: gains and offsets that nearly cancel are a
// direction in which a fit creeps, and their distance from the declared values is judged.
FitOptions complete_fit() {
  FitOptions options;
  options.iterations = 40;
  options.tolerance = 3.0e-6;
  return options;
}

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
      const double error = (readings[k - window.begin][c] - e.reading[k][c]) / e.noise_ratio[c];
      sum += error * error;
      samples += 1.0;
    }
    if (samples > 0.0 && std::isfinite(sum)) out[c].push_back(sum / samples);
  }
}

// Weighs channels without declared noise by their residuals in the median window: a wrong estimate
// of the noise then does not decide between channels, and windows that the hypothesis cannot follow
// do not bias its parameters.
void reweight(Task& task, const std::array<double, predicted_channels>& noise,
              const Hypothesis& hypothesis, const Fit& fitted) {
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
    task.sigma[c] = std::max(noise[c], std::sqrt(median(std::move(mean_square[c]))));
  }
}

// Close to the estimated noise the residuals are no longer a better estimate of it: the last steps
// weigh the channels by the noise itself. True if the weights have changed.
bool weigh_by_noise(const SearchData& data, Task& task) {
  const auto& noise = data.held_out.sigma;
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (task.sigma[c] > data.criteria.near_noise_factor * noise[c]) return false;
  }
  return std::exchange(task.sigma, noise) != noise;
}

// True for candidates that one of their tier is clearly better than, over the windows that both are
// fitted to: convergence of all of them would cost most of a diagnosis.
std::vector<bool> beaten_in_brief_fits(const SearchData& data,
                                       std::span<const FittedCandidate> candidates) {
  std::vector<HeldOut> briefly;
  for (const FittedCandidate& each : candidates) {
    briefly.push_back(score_of(each.fitted, data.train, *each.hypothesis, each.fitted.z, true));
  }
  std::vector<bool> beaten(candidates.size(), false);
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    for (std::size_t k = 0; k < candidates.size() && !beaten[i]; ++k) {
      beaten[i] = k != i && tier_of(candidates[k].candidate) == tier_of(candidates[i].candidate) &&
                  gain_chance(briefly[i], briefly[k]) < data.criteria.claim_level();
    }
  }
  return beaten;
}

void converge(const SearchData& data, FittedCandidate& each) {
  Task task = data.train;
  each.hypothesis = each.hypothesis->refined();
  each.fitted.z.resize(each.hypothesis->unknowns().size(), 0.0);
  reweight(task, data.held_out.sigma, *each.hypothesis, each.fitted);
  FitOptions options;
  options.tolerance = 1.0e-3;
  options.iterations = 8;
  each.fitted = fit(task, *each.hypothesis, each.fitted.z, each.fitted.state, options);
  if (!weigh_by_noise(data, task)) return;
  options.multistart = false;
  each.fitted = fit(task, *each.hypothesis, each.fitted.z, each.fitted.state, options);
}

// Declared values of the model, and fitted ones of the numbers that are freed.
std::vector<double> fresh_start(const Hypothesis& hypothesis, const FittedCandidate& each) {
  std::vector<double> z = carried_over(*each.hypothesis, each.fitted.z, hypothesis);
  for (std::size_t u = 0; u < z.size(); ++u) {
    if (!hypothesis.unknowns()[u].freed) z[u] = 0.0;
  }
  return z;
}

// The hypothesis of a candidate around the fitted sizes of its effects, without refinements.
Hypothesis unrefined(const Hypothesis& declared, const FittedCandidate& each) {
  const auto found = each.hypothesis->parameters(each.fitted.z);
  const auto& initial = each.hypothesis->rig().parameter_values();
  Hypothesis out = declared.with_uncertainties_of(each.hypothesis->model());
  if (const physics::Campaign* campaign = each.hypothesis->campaign()) {
    for (const physics::SharedNumber& number : campaign->numbers) out = out.sharing(number);
  }
  for (const physics::BoundTerm& term : each.hypothesis->trial_terms()) {
    std::vector<double> values = values_of(term, found);
    const std::vector<double> fixed = values_of(term, initial);
    const auto& cards = term.effect->card().parameters;
    for (std::size_t k = 0; k < cards.size(); ++k) {
      if (cards[k].fixed_default) values[k] = fixed[k];
    }
    out = out.with(*term.effect, term.place, values, {}, Detail::coarse);
  }
  for (const Unknown& unknown : each.hypothesis->unknowns()) {
    if (unknown.freed) out = out.freeing(unknown.parameter);
  }
  return out;
}

// True if `held_out` has noise that predicts better than the present one where nothing was fitted.
// A declared level is contradicted by nothing less than noise of just the found colour and level.
bool is_better_noise(const SearchData& data, const FittedCandidate& each, const Task& held_out,
                     bool contradicts_declaration) {
  const bool is_estimated = !noise_is_declared(data.experiments);
  const NoiseCheck check =
      noise_check(held_out, *each.hypothesis, each.fitted.z, is_estimated, data.criteria);
  if (!(contradicts_declaration ? check.is_expected_noise : check.is_noise)) return false;
  return noise_loss(data.held_out, *each.hypothesis, each.fitted.z) -
             noise_loss(held_out, *each.hypothesis, each.fitted.z) >=
         data.criteria.claim_nats();
}

// Noise is what the fit leaves, of a level and colour that make it white again, and that predict
// better. Of a fit that leaves physics it is not.
void learn_noise(SearchData& data, const FittedCandidate& each) {
  for (const bool keeps_declared : {false, true}) {
    const NoiseEstimate found = noise_in_residuals(data.train, *each.hypothesis, each.fitted,
                                                   keeps_declared, data.criteria);
    if (found.colour == data.train.colour && found.sigma == data.train.sigma) return;
    Task held_out = data.held_out;
    held_out.colour = found.colour;
    held_out.sigma = found.sigma;
    if (is_better_noise(data, each, held_out, found.contradicts_declaration)) {
      data.held_out = std::move(held_out);
      data.train.colour = found.colour;
      data.train.sigma = found.sigma;
      data.noise_is_known = true;
      return;
    }
    if (!found.contradicts_declaration) return;
  }
}

// A fit that explains the recordings with numbers of the rig beyond what the model allows for may
// be in a local minimum, at the edge of a slip for example: it is made again from the declared
// values of those. Instruments are left alone: a delay or gain that two channels share between them
// would be below the limit in both.
void retry_contradictions(const SearchData& data, FittedCandidate& each) {
  if (each.fitted.chi2_per_sample() > data.explained_chi2()) return;
  const std::vector<std::size_t> contradicted = contradicted_rig_unknowns(each, data.criteria);
  if (contradicted.empty()) return;
  std::vector<double> z = each.fitted.z;
  for (const std::size_t unknown : contradicted) z[unknown] = 0.0;
  Fit again = fit(data.train, *each.hypothesis, std::move(z), each.fitted.state, complete_fit());
  if (again.cost < each.fitted.cost) each.fitted = std::move(again);
}

}  // namespace

SearchData search_data(std::span<const Experiment> experiments, const Criteria& criteria,
                       std::uint64_t seed, int threads) {
  return {experiments,
          criteria,
          seed,
          threads,
          noise_is_declared(experiments),
          task_for(experiments, Use::fit, threads),
          task_for(experiments, Use::select, threads),
          nullptr};
}

Task task_for(std::span<const Experiment> experiments, Use use, int threads) {
  Task task;
  task.experiments = experiments;
  task.sigma = noise_sigma(experiments);
  task.threads = threads;
  for (std::size_t i = 0; i < experiments.size(); ++i) {
    for (std::size_t w = 0; w < experiments[i].windows.size(); ++w) {
      if (experiments[i].windows[w].use == use) task.windows.push_back({i, w});
    }
  }
  return task;
}

// Far from the solution a gain would run away with the load that it multiplies, and find back on a
// curved path only: instruments, which are known best, are freed last.
Fit fit_in_stages(const Task& task, const Hypothesis& hypothesis, const std::vector<double>& z,
                  const std::vector<WindowState>& states, const FitOptions& options) {
  Task beginning = task;
  beginning.share = first_stage_share;
  const Hypothesis held = holding_instruments(hypothesis);
  Fit before = fit(beginning, held, carried_over(hypothesis, z, held), states, brief_fit(3));
  if (held.unknowns().size() < hypothesis.unknowns().size()) {
    before = fit(task, held, before.z, before.state, brief_fit(options.iterations));
  }
  return fit(task, hypothesis, carried_over(held, before.z, hypothesis), before.state, options);
}

FittedCandidate calibrate(SearchData& data, const physics::Model& model) {
  FittedCandidate out;
  out.hypothesis.emplace(model, data.campaign);
  const std::vector<double> origin(out.hypothesis->unknowns().size(), 0.0);
  const auto guesses = initial_states(data.train, *out.hypothesis);
  out.fitted =
      fit_from_many_starts(data.train, *out.hypothesis, origin, guesses, data.seed, complete_fit());
  if (out.fitted.chi2_per_sample() > data.explained_chi2()) {
    // Without the missing physics the beginnings of windows may lead elsewhere than all of them.
    Fit at_once = fit(data.train, *out.hypothesis, origin, guesses, complete_fit());
    if (at_once.cost < out.fitted.cost) out.fitted = std::move(at_once);
  }
  settle(data, out);
  return out;
}

void settle(SearchData& data, FittedCandidate& each) {
  reweight(data.train, data.held_out.sigma, *each.hypothesis, each.fitted);
  weigh_by_noise(data, data.train);
  learn_noise(data, each);
  each.fitted = fit(data.train, *each.hypothesis, each.fitted.z, each.fitted.state, complete_fit());
  retry_contradictions(data, each);
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
  for (FittedCandidate& each : candidates) {
    each.fitted = fit(data.train, *each.hypothesis, each.fitted.z, each.fitted.state, brief_fit(4));
  }
  const std::vector<bool> beaten = beaten_in_brief_fits(data, candidates);
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (!beaten[i]) converge(data, candidates[i]);
  }
}

void fit_and_score(const SearchData& data, const FittedCandidate& current,
                   std::span<FittedCandidate> candidates) {
  fit_thoroughly(data, candidates);
  for (FittedCandidate& each : candidates) {
    const Hypothesis& hypothesis = *each.hypothesis;
    const HeldOut by_itself =
        held_out_score(data.held_out, hypothesis, each.fitted.z, data.noise_is_known);
    each.held_out = rescored_from(current.held_out, *current.hypothesis, data.held_out, hypothesis,
                                  each.fitted.z, by_itself, data.noise_is_known);
    each.gain_z = gain_z(current.held_out, each.held_out);
  }
}

bool is_near_noise(std::span<const FittedCandidate> candidates, const Criteria& criteria) {
  return std::ranges::any_of(candidates, [&](const FittedCandidate& each) {
    return each.held_out.chi2 < criteria.explained_chi2;
  });
}

void restart_best(const SearchData& data, const Hypothesis& declared,
                  const FittedCandidate& current, std::span<FittedCandidate> candidates,
                  const std::function<bool(const FittedCandidate&)>& may_restart) {
  std::vector<FittedCandidate*> best;
  for (FittedCandidate& each : candidates) {
    if (may_restart(each)) best.push_back(&each);
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
    fresh.fitted = fit_from_many_starts(data.train, hypothesis, fresh_start(hypothesis, *each),
                                        initial_states(data.train, hypothesis), data.seed,
                                        brief_fit(data.criteria.effort.rough_iterations));
    fit_and_score(data, current, {&fresh, 1});
    if (fresh.total_loss() < each->total_loss()) *each = std::move(fresh);
  }
}

bool refit_from(const SearchData& data, const FittedCandidate& other, FittedCandidate& each) {
  const Hypothesis& hypothesis = *each.hypothesis;
  Fit again =
      fit(data.train, hypothesis, carried_over(*other.hypothesis, other.fitted.z, hypothesis),
          warm_start_states(other.fitted.state, data.train, *other.hypothesis, hypothesis),
          complete_fit());
  if (!(again.cost < each.fitted.cost - 2.0)) return false;
  each.fitted = std::move(again);
  retry_contradictions(data, each);
  each.held_out = held_out_score(data.held_out, hypothesis, each.fitted.z, data.noise_is_known);
  return true;
}

}  // namespace stickslip::diagnosis
