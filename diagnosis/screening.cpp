#include "diagnosis/screening.h"

#include <algorithm>
#include <numeric>
#include <utility>

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

// Starts of the search for `hypothesis`, an extension of `base`: the fit so far, and the declared
// values where missing physics has pulled the calibration far away from them.
std::vector<std::vector<double>> starting_points(const FittedCandidate& base,
                                                 const Hypothesis& hypothesis, double distant) {
  std::vector<double> z = base.fitted.z;
  double farthest = 0.0;
  for (std::size_t u = 0; u < z.size(); ++u) {
    if (base.hypothesis->unknowns()[u].of_model) farthest = std::max(farthest, std::abs(z[u]));
  }
  z.resize(hypothesis.unknowns().size(), 0.0);
  std::vector<std::vector<double>> points{z};
  if (farthest > distant) {
    for (std::size_t u = 0; u < z.size(); ++u) {
      if (hypothesis.unknowns()[u].of_model) z[u] = 0.0;
    }
    points.push_back(z);
  }
  return points;
}

class Screening {
 public:
  Screening(const SearchData& data, const ResidualFeatures& features, const FittedCandidate& base)
      : data_(data), features_(features), base_(base), subset_(window_subset(data, base)) {}

  // The effect added to the base, from its best start.
  FittedCandidate screened(const CandidateEffect& candidate) const {
    FittedCandidate best;
    best.candidate = candidate;
    const auto scales =
        scales_of(data_.experiments, *base_.hypothesis, base_.fitted.z, features_, candidate.place);
    const auto fixed = candidate.effect->fixed(scales);
    FitOptions options;
    options.iterations = data_.criteria.effort.screening_iterations;
    options.covariance = false;
    options.multistart = false;
    for (const auto& start : candidate.effect->starts(scales)) {
      const Hypothesis hypothesis =
          base_.hypothesis->with(*candidate.effect, candidate.place, start, fixed, Detail::coarse);
      const auto points = starting_points(base_, hypothesis, data_.criteria.distant_calibration);
      for (std::size_t i = 0; i < points.size(); ++i) {
        Fit fitted = fit(subset_.task, hypothesis, points[i], states_for(hypothesis, i), options);
        if (!best.hypothesis || fitted.cost < best.fitted.cost) {
          best.hypothesis = hypothesis;
          best.fitted = std::move(fitted);
        }
      }
    }
    return best;
  }

  void fit_roughly(FittedCandidate& each) const {
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
  // From the declared values the states start from their first guesses too.
  std::vector<WindowState> states_for(const Hypothesis& hypothesis, std::size_t point) const {
    if (point > 0) return initial_states(subset_.task, hypothesis);
    return warm_start_states(subset_.state, subset_.task, *base_.hypothesis, hypothesis);
  }

  const SearchData& data_;
  const ResidualFeatures& features_;
  const FittedCandidate& base_;
  WindowSubset subset_;
};

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
  const auto chosen = chosen_windows(base.fitted, data.criteria.effort.screening_windows);
  WindowSubset subset;
  subset.task = train;
  subset.task.experiments = data.coarse;
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
    bool only_listed, const std::function<void(const std::string& step, double done)>& progress) {
  const Effort& effort = data.criteria.effort;
  std::vector<CandidateEffect> effects =
      candidate_effects(base.hypothesis->model(), data.experiments);
  if (only_listed) {
    std::erase_if(effects, [](const CandidateEffect& each) {
      return tier_of(each) != physics::Tier::listed;
    });
  }
  const Screening screening(data, features, base);
  progress("screening " + physics::counted(effects.size(), "effect"), 0.0);
  std::vector<FittedCandidate> candidates(effects.size());
  parallel::for_each(effects.size(), data.threads,
                     [&](std::size_t i) { candidates[i] = screening.screened(effects[i]); });
  std::erase_if(candidates, [](const FittedCandidate& each) { return !each.hypothesis; });
  const auto sort = [&] {
    const auto cost = [&](const FittedCandidate& each) {
      return each.fitted.cost + complexity_of(each, data.criteria);
    };
    std::stable_sort(
        candidates.begin(), candidates.end(),
        [&](const FittedCandidate& a, const FittedCandidate& b) { return cost(a) < cost(b); });
  };
  sort();
  keep_promising(candidates, base, effort.rough_fits);
  progress("refining the best effects", 0.5);
  parallel::for_each(candidates.size(), data.threads,
                     [&](std::size_t i) { screening.fit_roughly(candidates[i]); });
  sort();
  parallel::for_each(std::min(effort.refinements, candidates.size()), data.threads,
                     [&](std::size_t i) { screening.refine(candidates[i]); });
  sort();
  for (FittedCandidate& each : candidates) screening.extend_to_all_windows(each);
  return candidates;
}

}  // namespace stickslip::diagnosis
