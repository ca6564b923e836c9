// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/screening.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <iterator>
#include <numeric>
#include <optional>
#include <utility>

#include "diagnosis/first_step.h"
#include "diagnosis/many_starts.h"
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

bool is_plain_number(const CandidateEffect& each) {
  return each.is_number() && !each.is_comparison();
}

class Screening {
 public:
  Screening(const SearchData& data, const ResidualFeatures& features, const FittedCandidate& base,
            WindowSubset subset, bool is_declared)
      : data_(data),
        features_(features),
        base_(base),
        is_declared_(is_declared),
        subset_(std::move(subset)),
        first_steps_(subset_.task, base, subset_.state),
        cost_without_(first_steps_.cost_without()) {}
  Screening(const Screening&) = delete;
  Screening& operator=(const Screening&) = delete;

  const FittedCandidate& base() const { return base_; }

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
      if (is_plain_number(candidate)) add_factors(points, hypothesis);
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
    for (const CandidateEffect& each : candidates) {
      if (is_plain_number(each)) numbers.push_back(each);
    }
    if (numbers.size() <= most) return;
    const std::vector<double> gain = gains_of_numbers(subset_.task, base_, subset_.state, numbers);
    std::vector<double> sorted = gain;
    std::sort(sorted.begin(), sorted.end(), std::greater<>());
    std::size_t next = 0;
    std::erase_if(candidates, [&](const CandidateEffect& each) {
      return is_plain_number(each) && gain[next++] < sorted[most - 1];
    });
  }

  // Instruments that a calibration has put far away may not find back in stages.
  void fit_roughly(FittedCandidate& each) const {
    const Hypothesis& hypothesis = *each.hypothesis;
    const FitOptions options = brief_fit(data_.criteria.effort.rough_iterations);
    const auto fit_from = is_declared_ ? fit_growing_beginnings : fit_in_stages;
    Fit fitted = fit_from(subset_.task, hypothesis, each.fitted.z, each.fitted.state, options);
    if (fitted.cost < each.fitted.cost) each.fitted = std::move(fitted);
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

  const SearchData& data_;
  const ResidualFeatures& features_;
  const FittedCandidate& base_;
  bool is_declared_;  // the base has its declared values
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

// A candidate, and the screening beside whose base it was fitted.
struct Screened {
  FittedCandidate candidate;
  const Screening* from = nullptr;
};

// Of the differences between recordings, which are tried for every number, the best.
void keep_best_comparisons(std::vector<Screened>& candidates, std::size_t most) {
  std::size_t kept = 0;
  std::erase_if(candidates, [&](const Screened& each) {
    return each.candidate.candidate.is_comparison() && kept++ >= most;
  });
}

// The best candidates, and those that one step cannot judge because they replace a law.
void keep_promising(std::vector<Screened>& candidates, const FittedCandidate& base,
                    std::size_t count) {
  std::size_t kept = std::min(candidates.size(), count);
  for (std::size_t i = kept; i < candidates.size(); ++i) {
    if (replaces_law(*base.hypothesis, *candidates[i].candidate.hypothesis)) {
      std::swap(candidates[kept++], candidates[i]);
    }
  }
  candidates.erase(candidates.begin() + static_cast<std::ptrdiff_t>(kept), candidates.end());
}

void sort_by_cost(std::vector<Screened>& candidates, const Criteria& criteria) {
  const auto cost = [&](const Screened& each) {
    return each.candidate.fitted.cost + complexity_of(each.candidate, criteria);
  };
  std::ranges::stable_sort(candidates, {}, cost);
}

// Of the fits of one candidate from different bases the better, which comes first.
void keep_better_of_twins(std::vector<Screened>& candidates) {
  std::vector<Screened> kept;
  for (Screened& each : candidates) {
    const bool is_twin = std::ranges::any_of(kept, [&](const Screened& better) {
      return better.candidate.candidate == each.candidate.candidate;
    });
    if (!is_twin) kept.push_back(std::move(each));
  }
  candidates = std::move(kept);
}

// The base at its declared values, where its calibration is implausible: missing physics has pulled
// it there, and a step from it may lead anywhere but back.
std::optional<FittedCandidate> at_declared_values(const SearchData& data,
                                                  const FittedCandidate& base) {
  const double penalty = prior_penalty(*base.hypothesis, base.fitted.z);
  if (penalty <= data.criteria.implausible_prior_penalty) return std::nullopt;
  FittedCandidate out = base;
  for (std::size_t u = 0; u < out.fitted.z.size(); ++u) {
    if (base.hypothesis->unknowns()[u].of_model) out.fitted.z[u] = 0.0;
  }
  Task task = data.train;
  task.steps = Steps::coarse;
  out.fitted = fit_states(task, *out.hypothesis, out.fitted.z, brief_fit(6));
  return out;
}

WindowSubset with_states_of(WindowSubset subset, const FittedCandidate& base) {
  for (std::size_t i = 0; i < subset.window.size(); ++i) {
    subset.state[i] = base.fitted.state[subset.window[i]];
  }
  return subset;
}

// The effects that the base may lack, and the most promising of its numbers.
std::vector<CandidateEffect> effects_beside(const SearchData& data, const FittedCandidate& base,
                                            const CandidateFilter& wanted,
                                            const Screening& screening) {
  std::vector<CandidateEffect> out =
      candidate_effects(base.hypothesis->model(), data.experiments, base.hypothesis->campaign());
  if (const physics::Campaign* campaign = base.hypothesis->campaign()) {
    const auto more = comparison_candidates(base.hypothesis->model(), data.experiments, *campaign);
    out.insert(out.end(), more.begin(), more.end());
  }
  erase_unknown_numbers(out, *base.hypothesis);
  if (wanted) std::erase_if(out, std::not_fn(wanted));
  screening.keep_best_numbers(out, data.criteria.effort.rough_numbers);
  return out;
}

// The candidates that gain most in their first steps beside one base.
std::vector<Screened> best_screened(const SearchData& data, const Screening& screening,
                                    const std::vector<CandidateEffect>& effects, std::size_t most) {
  std::vector<std::optional<FittedCandidate>> screened(effects.size());
  parallel::for_each(effects.size(), data.threads,
                     [&](std::size_t i) { screened[i] = screening.screened(effects[i]); });
  std::vector<Screened> out;
  for (auto& each : screened) {
    if (each) out.push_back({*std::move(each), &screening});
  }
  sort_by_cost(out, data.criteria);
  const FittedCandidate& base = screening.base();
  if (base.hypothesis->recordings() > 1) {
    keep_best_comparisons(out, data.criteria.effort.rough_numbers);
  }
  keep_promising(out, base, most);
  return out;
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
  const WindowSubset subset = window_subset(data, base);
  const std::optional<FittedCandidate> declared = at_declared_values(data, base);
  std::deque<Screening> from;
  from.emplace_back(data, features, base, subset, false);
  if (declared) {
    from.emplace_back(data, features, *declared, with_states_of(subset, *declared), true);
  }
  const std::vector<CandidateEffect> effects = effects_beside(data, base, wanted, from.front());
  std::size_t numbers = static_cast<std::size_t>(std::ranges::count_if(effects, is_plain_number));
  if (base.hypothesis->recordings() > 1) numbers += effort.rough_numbers;

  progress("screening " + physics::counted(effects.size(), "effect"), 0.0);
  std::vector<Screened> candidates;
  for (const Screening& each : from) {
    std::ranges::move(best_screened(data, each, effects, effort.rough_fits + numbers),
                      std::back_inserter(candidates));
  }
  progress("refining the best effects", 0.5);
  parallel::for_each(candidates.size(), data.threads, [&](std::size_t i) {
    candidates[i].from->fit_roughly(candidates[i].candidate);
  });
  std::erase_if(candidates, [&](const Screened& each) {
    return replaces_law(*base.hypothesis, *each.candidate.hypothesis) &&
           !each.from->is_promising(each.candidate);
  });
  sort_by_cost(candidates, data.criteria);
  keep_better_of_twins(candidates);
  parallel::for_each(std::min(effort.refinements + numbers, candidates.size()), data.threads,
                     [&](std::size_t i) { candidates[i].from->refine(candidates[i].candidate); });
  sort_by_cost(candidates, data.criteria);
  std::vector<FittedCandidate> out;
  for (Screened& each : candidates) {
    each.from->extend_to_all_windows(each.candidate);
    out.push_back(std::move(each.candidate));
  }
  return out;
}

}  // namespace stickslip::diagnosis
