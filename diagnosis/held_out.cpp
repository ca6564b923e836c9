// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/held_out.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <random>

#include "diagnosis/median.h"
#include "diagnosis/score.h"
#include "diagnosis/significance.h"

namespace stickslip::diagnosis {

namespace {

// Half the negative log-likelihood of residuals whose scale is not known better than the noise, so
// that neither one diverged window nor a wrong noise level decides.
double window_loss(double chi2, int count) {
  return 0.5 * count * std::log1p(chi2 / std::max(1, count));
}

double likelihood_loss(const Fit& fitted, std::size_t w) {
  return window_loss(fitted.chi2[w], fitted.count[w]) + fitted.state_cost[w];
}

FitOptions states_only() {
  FitOptions options;
  options.parameters_free = false;
  options.iterations = 12;
  options.tolerance = 1.0e-3;
  return options;
}

// True for a gain that is certain although few windows show it, as of an effect that matters at
// large amplitudes only, or of one that a calibration far from the declared values had absorbed:
// the spread over windows is not informative then. The best window alone is no proof, and no more
// than the share `most_lost` of the gain may be lost elsewhere.
bool is_gain_in_nats(const HeldOut& before, const HeldOut& after, double most_lost,
                     const Criteria& criteria) {
  const double of_prior = before.prior_penalty - after.prior_penalty;
  double gained = std::max(0.0, of_prior);
  double lost = std::max(0.0, -of_prior);
  double most = 0.0;
  for (std::size_t w = 0; w < before.loss.size(); ++w) {
    const double gain = before.loss[w] - after.loss[w];
    (gain > 0.0 ? gained : lost) += std::abs(gain);
    most = std::max(most, gain);
  }
  return gained - most - lost > criteria.claim_nats() && lost < most_lost * gained;
}

// Decrease of chi-squared per sample, the prior penalty included.
double gained_chi2(const HeldOut& before, const HeldOut& after) {
  const std::vector<int>& count = after.fitted.count;
  const double samples = std::max(1, std::accumulate(count.begin(), count.end(), 0));
  return before.chi2 - after.chi2 + 2.0 * (before.prior_penalty - after.prior_penalty) / samples;
}

// By Student's t, which few windows of like gains satisfy, or by signs, which gains of very
// different sizes do.
bool is_beyond_chance(const HeldOut& before, const HeldOut& after, const Criteria& criteria) {
  const double level = criteria.claim_level();
  return gain_chance(before, after) < level || sign_chance(before, after) < level;
}

}  // namespace

double prior_penalty(const Hypothesis& hypothesis, std::span<const double> z) {
  double penalty = 0.0;
  for (std::size_t u = 0; u < z.size(); ++u) {
    if (hypothesis.unknowns()[u].of_model) penalty += 0.5 * z[u] * z[u];
  }
  return penalty;
}

double HeldOut::total_loss() const {
  return std::accumulate(loss.begin(), loss.end(), prior_penalty);
}

HeldOut score_of(const Fit& fitted, const Task& task, const Hypothesis& hypothesis,
                 std::span<const double> z, bool noise_is_known) {
  HeldOut out;
  out.fitted = fitted;
  out.chi2 = fitted.chi2_per_sample();
  std::vector<double> by_window;
  for (std::size_t w = 0; w < fitted.chi2.size(); ++w) {
    by_window.push_back(fitted.chi2[w] / std::max(1, fitted.count[w] - fitted.states_per_window));
  }
  out.typical_chi2 = median(std::move(by_window));
  if (noise_is_known) {
    for (std::size_t w = 0; w < fitted.chi2.size(); ++w) {
      out.loss.push_back(likelihood_loss(fitted, w));
    }
    out.prior_penalty = prior_penalty(hypothesis, z);
  } else {
    const PredictionErrors ahead = predict_ahead(task, hypothesis, z);
    for (std::size_t w = 0; w < ahead.chi2.size(); ++w) {
      out.loss.push_back(window_loss(ahead.chi2[w], ahead.count[w]));
    }
  }
  return out;
}

HeldOut held_out_score(const Task& held_out, const Hypothesis& hypothesis,
                       std::span<const double> z, bool noise_is_known) {
  const Fit fitted = fit_states(held_out, hypothesis, z, states_only());
  return score_of(fitted, held_out, hypothesis, z, noise_is_known);
}

HeldOut rescored_from(const HeldOut& other, const Hypothesis& other_hypothesis,
                      const Task& held_out, const Hypothesis& hypothesis, std::span<const double> z,
                      const HeldOut& found, bool noise_is_known) {
  FitOptions options = states_only();
  options.multistart = false;
  const Fit again =
      fit(held_out, hypothesis, {z.begin(), z.end()},
          warm_start_states(other.fitted.state, held_out, other_hypothesis, hypothesis), options);
  Fit best = found.fitted;
  for (std::size_t w = 0; w < best.chi2.size(); ++w) {
    if (!(likelihood_loss(again, w) < likelihood_loss(best, w))) continue;
    best.chi2[w] = again.chi2[w];
    best.count[w] = again.count[w];
    best.state[w] = again.state[w];
    best.state_cost[w] = again.state_cost[w];
  }
  return score_of(best, held_out, hypothesis, z, noise_is_known);
}

ScoreGain score_gain(const HeldOut& before, const HeldOut& after) {
  const std::size_t n = before.loss.size();
  ScoreGain out;
  for (std::size_t w = 0; w < n; ++w) out.value += before.loss[w] - after.loss[w];
  if (n < 2) return out;
  const auto windows = static_cast<double>(n);
  double square = 0.0;
  for (std::size_t w = 0; w < n; ++w) {
    const double off = before.loss[w] - after.loss[w] - out.value / windows;
    square += off * off;
  }
  out.se = std::sqrt(square * windows / (windows - 1.0));
  return out;
}

double gain_z(const HeldOut& before, const HeldOut& after) {
  const ScoreGain gain = score_gain(before, after);
  if (!(gain.se > 0.0)) return 0.0;
  return deviate_of_student(gain.value / gain.se, static_cast<double>(before.loss.size() - 1));
}

double gain_chance(const HeldOut& before, const HeldOut& after) {
  return normal_chance(gain_z(before, after));
}

double sign_chance(const HeldOut& before, const HeldOut& after) {
  constexpr std::size_t exact_windows = 14;
  constexpr std::uint64_t draws = std::uint64_t{1} << exact_windows;
  const std::size_t n = before.loss.size();
  if (n == 0) return 1.0;
  std::vector<double> gain(n);
  for (std::size_t w = 0; w < n; ++w) gain[w] = before.loss[w] - after.loss[w];
  const double least = std::accumulate(gain.begin(), gain.end(), 0.0) * (1.0 - 1.0e-12);
  const bool exact = n <= exact_windows;
  const std::uint64_t count = exact ? std::uint64_t{1} << n : draws;
  std::mt19937_64 random(n);
  std::uint64_t reached = exact ? 0 : 1;  // that of the signs themselves
  for (std::uint64_t draw = 0; draw < count; ++draw) {
    std::uint64_t signs = exact ? draw : random();
    double sum = 0.0;
    for (std::size_t w = 0; w < n; ++w, signs >>= 1U) {
      if (w > 0 && w % 64 == 0) signs = random();
      sum += (signs & 1U) != 0 ? gain[w] : -gain[w];
    }
    if (sum >= least) ++reached;
  }
  return static_cast<double>(reached) / static_cast<double>(count + (exact ? 0 : 1));
}

bool is_gain(const HeldOut& before, const HeldOut& after, bool noise_is_known,
             const Criteria& criteria, double least_chi2) {
  // Where no more than noise is left in a typical window, losses are likelihoods, whose sum counts.
  // That confirms an estimate of the noise, too, as not too small. Where more is left, only a gain
  // that hardly any window contradicts is certain.
  const bool is_near_noise = std::log(after.typical_chi2) < criteria.confirmed_noise_log;
  const double most_lost = is_near_noise ? 1.0 : criteria.negligible_share;
  const bool certain =
      is_beyond_chance(before, after, criteria) ||
      ((noise_is_known || is_near_noise) && is_gain_in_nats(before, after, most_lost, criteria));
  return certain && gained_chi2(before, after) > least_chi2;
}

bool is_major_gain(const HeldOut& before, const HeldOut& after, bool noise_is_known,
                   const Criteria& criteria, double least_chi2) {
  const double excess = std::max(before.chi2 - 1.0, 1.0);
  const bool explained = after.chi2 <= explained_chi2(noise_is_known, criteria);
  return is_gain(before, after, noise_is_known, criteria, least_chi2) &&
         (explained || before.chi2 - after.chi2 > criteria.claim_share_unexplained * excess);
}

double explained_chi2(bool noise_is_known, const Criteria& criteria) {
  return noise_is_known ? criteria.explained_chi2 : criteria.explained_chi2_estimated_noise;
}

}  // namespace stickslip::diagnosis
