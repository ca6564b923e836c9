// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/selection.h"

#include <cmath>
#include <numeric>
#include <random>

namespace stickslip::diagnosis {

namespace {

// Mean weights exp(-loss), normalised in each draw of window weights.
std::vector<double> bootstrap_weights(const std::vector<FittedCandidate>& candidates,
                                      std::size_t draws, std::uint64_t seed) {
  const std::size_t n = candidates.front().held_out.loss.size();
  std::vector<double> weight(candidates.size(), 0.0);
  std::mt19937_64 random(seed);
  std::exponential_distribution<double> exponential(1.0);
  std::vector<double> share(n);
  std::vector<double> total(candidates.size());
  for (std::size_t draw = 0; draw < draws; ++draw) {
    double sum = 0.0;
    for (double& each : share) sum += each = exponential(random);
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      total[k] = candidates[k].held_out.prior_penalty;
      for (std::size_t w = 0; w < n; ++w) {
        total[k] += share[w] / sum * static_cast<double>(n) * candidates[k].held_out.loss[w];
      }
    }
    const double best = *std::min_element(total.begin(), total.end());
    double normal = 0.0;
    for (const double each : total) normal += std::exp(best - each);
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      weight[k] += std::exp(best - total[k]) / normal / static_cast<double>(draws);
    }
  }
  return weight;
}

void sort_by_probability(std::vector<FittedCandidate>& candidates,
                         const std::vector<double>& weight) {
  std::vector<std::size_t> order(candidates.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    if (weight[a] != weight[b]) return weight[a] > weight[b];
    return candidates[a].total_loss() < candidates[b].total_loss();
  });
  std::vector<FittedCandidate> sorted;
  sorted.reserve(order.size());
  for (const std::size_t k : order) sorted.push_back(std::move(candidates[k]));
  candidates = std::move(sorted);
}

// Index of the simplest candidate that the most probable one does not clearly beat.
std::size_t simplest(const std::vector<FittedCandidate>& candidates, double gain,
                     const Criteria& criteria) {
  std::size_t chosen = 0;
  for (std::size_t k = 1; k < candidates.size(); ++k) {
    if (complexity_of(candidates[k], criteria) < complexity_of(candidates[chosen], criteria) &&
        is_preferred(candidates[k], candidates.front(), gain, criteria)) {
      chosen = k;
    }
  }
  return chosen;
}

// Loss without the prior penalty of instruments beyond what the model allows for: these are
// findings of their own, whichever effect is claimed first, and a shape that bends as they do is no
// reason against a listed effect.
double loss_beside_instruments(const FittedCandidate& each, const Criteria& criteria) {
  double loss = each.total_loss();
  const std::vector<double>& z = each.fitted.z;
  for (const std::size_t number :
       each.hypothesis->instruments_beyond(z, criteria.contradicted_sigmas)) {
    const double distance = z[each.hypothesis->unknown_of(number).value()];
    loss -= 0.5 * distance * distance;
  }
  return loss;
}

// Index of the candidate of a lower tier that is preferred to the chosen one: because it is behind
// by no more than chance or than what its formula may leave, or, where the chosen one does not
// explain the recording either, because it gains at all.
std::size_t lower_tier(const std::vector<FittedCandidate>& candidates, std::size_t chosen,
                       const SearchData& data, const HeldOut& current, double gain) {
  const Criteria& criteria = data.criteria;
  const double best = loss_beside_instruments(candidates.front(), criteria);
  const bool explained = candidates[chosen].held_out.chi2 <= data.explained_chi2();
  for (std::size_t k = 0; k < candidates.size(); ++k) {
    const FittedCandidate& each = candidates[k];
    if (tier_of(each.candidate) >= tier_of(candidates[chosen].candidate)) continue;
    const double behind = std::max(criteria.claim_nats(), formula_residual(each.candidate) * gain);
    const bool nearly = loss_beside_instruments(each, criteria) < best + behind;
    // A number is no physics of its own: it displaces a formula by what it explains alone.
    const bool may_explain_part = !explained && !each.candidate.is_number();
    if (nearly || (may_explain_part &&
                   is_major_gain(current, each.held_out, data.noise_is_known, criteria, 0.0))) {
      chosen = k;
    }
  }
  return chosen;
}

}  // namespace

std::vector<double> probabilities(const std::vector<FittedCandidate>& candidates,
                                  const Criteria& criteria, std::uint64_t seed) {
  std::vector<double> weight = bootstrap_weights(candidates, criteria.effort.bootstrap_draws, seed);
  // Every parameter and hidden state makes a hypothesis less probable a priori.
  double sum = 0.0;
  for (std::size_t k = 0; k < weight.size(); ++k) {
    weight[k] *= std::exp(complexity_of(candidates.front(), criteria) -
                          complexity_of(candidates[k], criteria));
    sum += weight[k];
  }
  for (double& each : weight) each /= sum;
  return weight;
}

bool is_preferred(const FittedCandidate& simple, const FittedCandidate& best, double gain,
                  const Criteria& criteria) {
  const double behind = simple.total_loss() - best.total_loss();
  const double error = score_gain(simple.held_out, best.held_out).se;
  return behind < criteria.preference_errors * error && behind < criteria.negligible_share * gain;
}

void rank(std::vector<FittedCandidate>& candidates, const SearchData& data, const HeldOut& current,
          std::uint64_t seed) {
  sort_by_probability(candidates, probabilities(candidates, data.criteria, seed));
  const double gain = current.total_loss() - candidates.front().total_loss();
  const std::size_t simple = simplest(candidates, gain, data.criteria);
  move_to_front(candidates, lower_tier(candidates, simple, data, current, gain));
}

}  // namespace stickslip::diagnosis
