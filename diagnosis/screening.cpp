// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/screening.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <optional>
#include <utility>

#include "diagnosis/first_step.h"
#include "diagnosis/number_scores.h"
#include "diagnosis/parallel/for_each.h"
#include "physics/number_text.h"

namespace stickslip::diagnosis {

namespace {

// True by window of the task if it belongs to the subset.
std::vector<bool> chosen_windows(const Fit& fitted, std::size_t most) {
  const std::size_t all = fitted.chi2.size();
  std::vector<std::size_t> worst(all);
  std::iota(worst.begin(), worst.end(), std::size_t{0});
  const auto mean_square = [&](std::size_t w) {
    return fitted.chi2[w] / std::max(1, fitted.count[w]);
  };
  std::stable_sort(worst.begin(), worst.end(),
                   [&](std::size_t a, std::size_t b) { return mean_square(a) > mean_square(b); });
  std::vector<bool> chosen(all, false);
  const std::size_t count = std::min(all, most);
  for (std::size_t i = 0; i < count / 2; ++i) chosen[i * all / (count / 2)] = true;
  std::size_t left = count - count / 2;
  for (std::size_t i = 0; i < all && left > 0; ++i) {
    if (chosen[worst[i]]) continue;
    chosen[worst[i]] = true;
    --left;
  }
  return chosen;
}

// True if missing physics has pulled the calibration of `base` far away from the declared values.
bool is_distant(const FittedCandidate& base, double most) {
  for (std::size_t u = 0; u < base.fitted.z.size(); ++u) {
    if (base.hypothesis->unknowns()[u].of_model && std::abs(base.fitted.z[u]) > most) return true;
  }
  return false;
}

// A number that is wrong by a factor is searched from both sides too: every start covers about a
// decade.
void add_factors(std::vector<std::vector<double>>& points, const Hypothesis& hypothesis) {
  constexpr double factor = 3.0;
  std::vector<std::vector<double>> more;
  for (const std::vector<double>& point : points) {
    const std::size_t freed = point.size() - 1;
    if (!hypothesis.unknowns()[freed].logarithmic) continue;
    for (const double way : {-1.0, 1.0}) {
      more.push_back(point);
      more.back()[freed] += way * std::log(factor);
    }
  }
  points.insert(points.end(), more.begin(), more.end());
}

// Starting values of the candidate's parameters; a number has one, its own.
std::vector<std::vector<double>> starts_of(const CandidateEffect& candidate,
                                           const physics::Scales& scales) {
  if (candidate.is_number()) return {{}};
  return candidate.effect->starts(scales);
}

class Screening {
 public:
  Screening(const SearchData& data, const ResidualFeatures& features, const FittedCandidate& base)
      : data_(data),
        features_(features),
        base_(base),
        subset_(window_subset(data, base)),
        first_steps_(subset_.task, base, subset_.state),
        cost_without_(first_steps_.cost_without()) {}

  // True if the effect may be claimed: if it gains on the windows to select on what it gains here,
  // less the half nat of chance for each unknown, the gain that a claim needs is within two
  // standard deviations. A log likelihood ratio has a variance of twice its expectation; a cost is
  // twice a negative log likelihood. In chaotic motion the gain to first order is the better
  // promise.
  bool is_promising(const FittedCandidate& each, double first_order_gain = 0.0) const {
    const double gain = std::max(first_order_gain, cost_without_ - each.fitted.cost);
    const double chance =
        static_cast<double>(each.fitted.z.size()) - static_cast<double>(base_.fitted.z.size());
    const double expected = 0.5 * std::max(0.0, gain - chance) *
                            static_cast<double>(data_.held_out.windows.size()) /
                            static_cast<double>(subset_.task.windows.size());
    return expected + 2.0 * std::sqrt(2.0 * expected) >= data_.criteria.claim_nats();
  }

  // The effect added to the base, after a step from its best start; none if it promises nothing.
  // One step cannot judge an effect that replaces a law.
  std::optional<FittedCandidate> screened(const CandidateEffect& candidate) const {
    FittedCandidate best;
    best.candidate = candidate;
    const auto scales =
        scales_of(data_.experiments, *base_.hypothesis, base_.fitted.z, features_, candidate.place);
    const auto fixed = candidate.effect->fixed(scales);
    const auto starts = starts_of(candidate, scales);
    if (auto gradual = first_steps_.after(candidate, starts, fixed)) {
      if (!is_promising(gradual->candidate, gradual->gain)) return std::nullopt;
      return std::move(gradual->candidate);
    }
    for (const auto& start : starts) {
      const Hypothesis hypothesis =
          extended(*base_.hypothesis, candidate, start, fixed, Detail::coarse);
      std::vector<std::vector<double>> points{
          carried_over(*base_.hypothesis, base_.fitted.z, hypothesis)};
      if (candidate.is_number() && !candidate.is_comparison()) add_factors(points, hypothesis);
      const auto states =
          warm_start_states(subset_.state, subset_.task, *base_.hypothesis, hypothesis);
      for (const std::vector<double>& point : points) {
        Fit fitted = fit(subset_.task, hypothesis, point, states, first_fit());
        if (!best.hypothesis || fitted.cost < best.fitted.cost) {
          best.hypothesis = hypothesis;
          best.fitted = std::move(fitted);
        }
      }
    }
    if (!best.hypothesis) return std::nullopt;
    if (!is_promising(best) && !replaces_law(*base_.hypothesis, *best.hypothesis)) {
      return std::nullopt;
    }
    return best;
  }

  // Of the numbers, the `most` that gain most to first order. All effects are kept.
  void keep_best_numbers(std::vector<CandidateEffect>& candidates, std::size_t most) const {
    std::vector<CandidateEffect> numbers;
    const auto is_plain = [](const CandidateEffect& each) {
      return each.is_number() && !each.is_comparison();
    };
    for (const CandidateEffect& each : candidates) {
      if (is_plain(each)) numbers.push_back(each);
    }
    if (numbers.size() <= most) return;
    const std::vector<double> gain = gains_of_numbers(subset_.task, base_, subset_.state, numbers);
    std::vector<double> sorted = gain;
    std::sort(sorted.begin(), sorted.end(), std::greater<>());
    std::size_t next = 0;
    std::erase_if(candidates, [&](const CandidateEffect& each) {
      return is_plain(each) && gain[next++] < sorted[most - 1];
    });
  }

  // From the fit so far, or, where that has moved far away, from the declared values and first
  // guesses of the states, whichever is better.
  void fit_roughly(FittedCandidate& each) const {
    if (is_distant(base_, data_.criteria.distant_calibration)) {
      Fit fitted = fit(subset_.task, *each.hypothesis, declared_point(*each.hypothesis),
                       initial_states(subset_.task, *each.hypothesis), first_fit());
      if (fitted.cost < each.fitted.cost) each.fitted = std::move(fitted);
    }
    each.fitted = fit_in_stages(subset_.task, *each.hypothesis, each.fitted.z, each.fitted.state,
                                brief_fit(data_.criteria.effort.rough_iterations));
  }

  void refine(FittedCandidate& each) const {
    each.fitted = fit(subset_.task, *each.hypothesis, each.fitted.z, each.fitted.state,
                      brief_fit(data_.criteria.effort.refinement_iterations));
  }

  // Windows outside the subset start from the states of the base.
  void extend_to_all_windows(FittedCandidate& each) const {
    std::vector<WindowState> states =
        warm_start_states(base_.fitted.state, data_.train, *base_.hypothesis, *each.hypothesis);
    for (std::size_t i = 0; i < subset_.window.size(); ++i) {
      states[subset_.window[i]] = each.fitted.state[i];
    }
    each.fitted.state = std::move(states);
  }

 private:
  FitOptions first_fit() const {
    FitOptions options;
    options.iterations = data_.criteria.effort.screening_iterations;
    options.own_steps = 0;
    options.covariance = false;
    options.multistart = false;
    return options;
  }

  // The declared values, beside the effect at its start.
  std::vector<double> declared_point(const Hypothesis& hypothesis) const {
    std::vector<double> z = carried_over(*base_.hypothesis, base_.fitted.z, hypothesis);
    for (std::size_t u = 0; u < z.size(); ++u) {
      if (hypothesis.unknowns()[u].of_model) z[u] = 0.0;
    }
    return z;
  }

  const SearchData& data_;
  const ResidualFeatures& features_;
  const FittedCandidate& base_;
  WindowSubset subset_;
  FirstSteps first_steps_;
  double cost_without_;  // of the base on the subset
};

// Numbers that are unknown already, as part of a term on trial or freed, are no candidates.
void erase_unknown_numbers(std::vector<CandidateEffect>& candidates, const Hypothesis& base) {
  const auto& paths = base.rig().parameter_paths();
  std::erase_if(candidates, [&](const CandidateEffect& each) {
    return std::any_of(base.unknowns().begin(), base.unknowns().end(), [&](const Unknown& unknown) {
      return !unknown.of_model && paths[unknown.parameter] == each.parameter;
    });
  });
}

// Of the differences between recordings, which are tried for every number, the best.
void keep_best_comparisons(std::vector<FittedCandidate>& candidates, std::size_t most) {
  std::size_t kept = 0;
  std::erase_if(candidates, [&](const FittedCandidate& each) {
    return each.candidate.is_comparison() && kept++ >= most;
  });
}

// The best candidates, and those that one step cannot judge because they replace a law.
void keep_promising(std::vector<FittedCandidate>& candidates, const FittedCandidate& base,
                    std::size_t count) {
  std::size_t kept = std::min(candidates.size(), count);
  for (std::size_t i = kept; i < candidates.size(); ++i) {
    if (replaces_law(*base.hypothesis, *candidates[i].hypothesis)) {
      std::swap(candidates[kept++], candidates[i]);
    }
  }
  candidates.erase(candidates.begin() + static_cast<std::ptrdiff_t>(kept), candidates.end());
}

}  // namespace

WindowSubset window_subset(const SearchData& data, const FittedCandidate& base) {
  const Task& train = data.train;
  const Effort& effort = data.criteria.effort;
  const auto chosen = chosen_windows(
      base.fitted, effort.screening_windows +
                       (base.hypothesis->recordings() - 1) * effort.screening_windows_of_recording);
  WindowSubset subset;
  subset.task = train;
  subset.task.steps = Steps::coarse;
  subset.task.windows.clear();
  subset.task.threads = 1;
  for (std::size_t w = 0; w < train.windows.size(); ++w) {
    if (!chosen[w]) continue;
    subset.window.push_back(w);
    subset.task.windows.push_back(train.windows[w]);
    subset.state.push_back(base.fitted.state[w]);
  }
  return subset;
}

std::vector<FittedCandidate> screen(
    const SearchData& data, const ResidualFeatures& features, const FittedCandidate& base,
    const CandidateFilter& wanted,
    const std::function<void(const std::string& step, double done)>& progress) {
  const Effort& effort = data.criteria.effort;
  std::vector<CandidateEffect> effects =
      candidate_effects(base.hypothesis->model(), data.experiments, base.hypothesis->campaign());
  if (const physics::Campaign* campaign = base.hypothesis->campaign()) {
    const auto more = comparison_candidates(base.hypothesis->model(), data.experiments, *campaign);
    effects.insert(effects.end(), more.begin(), more.end());
  }
  erase_unknown_numbers(effects, *base.hypothesis);
  if (wanted) std::erase_if(effects, std::not_fn(wanted));
  const Screening screening(data, features, base);
  screening.keep_best_numbers(effects, effort.rough_numbers);
  const auto plain_numbers = std::count_if(
      effects.begin(), effects.end(),
      [](const CandidateEffect& each) { return each.is_number() && !each.is_comparison(); });
  std::size_t numbers = static_cast<std::size_t>(plain_numbers);
  progress("screening " + physics::counted(effects.size(), "effect"), 0.0);
  std::vector<std::optional<FittedCandidate>> screened(effects.size());
  parallel::for_each(effects.size(), data.threads,
                     [&](std::size_t i) { screened[i] = screening.screened(effects[i]); });
  std::vector<FittedCandidate> candidates;
  for (auto& each : screened) {
    if (each) candidates.push_back(*std::move(each));
  }
  const auto sort = [&] {
    const auto cost = [&](const FittedCandidate& each) {
      return each.fitted.cost + complexity_of(each, data.criteria);
    };
    std::stable_sort(
        candidates.begin(), candidates.end(),
        [&](const FittedCandidate& a, const FittedCandidate& b) { return cost(a) < cost(b); });
  };
  sort();
  if (base.hypothesis->recordings() > 1) {
    keep_best_comparisons(candidates, effort.rough_numbers);
    numbers += effort.rough_numbers;
  }
  keep_promising(candidates, base, effort.rough_fits + numbers);
  progress("refining the best effects", 0.5);
  parallel::for_each(candidates.size(), data.threads,
                     [&](std::size_t i) { screening.fit_roughly(candidates[i]); });
  std::erase_if(candidates, [&](const FittedCandidate& each) {
    return replaces_law(*base.hypothesis, *each.hypothesis) && !screening.is_promising(each);
  });
  sort();
  parallel::for_each(std::min(effort.refinements + numbers, candidates.size()), data.threads,
                     [&](std::size_t i) { screening.refine(candidates[i]); });
  sort();
  for (FittedCandidate& each : candidates) screening.extend_to_all_windows(each);
  return candidates;
}

}  // namespace stickslip::diagnosis
