// SPDX-License-Identifier: Apache-2.0
// Score of a hypothesis on held-out windows, and the gain of one hypothesis over another.
#pragma once

#include <span>
#include <vector>

#include "diagnosis/criteria.h"
#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

struct HeldOut {
  std::vector<double> loss;   ///< by window [nat where the noise is known]
  double chi2 = 0.0;          ///< per sample, window states refitted
  double typical_chi2 = 0.0;  ///< the same of the median window
  /// Half the sum of squares of the calibrated parameters' distances from their declared values, in
  /// standard deviations [nat]; 0 where the noise is not known and losses are no likelihoods.
  double prior_penalty = 0.0;
  Fit fitted;  ///< of the window states

  /// Losses of all windows and the prior penalty.
  double total_loss() const;
};

/// HeldOut::prior_penalty of parameters `z`.
double prior_penalty(const Hypothesis& hypothesis, std::span<const double> z);

/// Score of parameters `z` on windows that are not part of their fit. Where the noise is known,
/// losses are of the refitted windows: without a missing effect their
/// residuals are white, and every nat counts. Where it is not, every model is wrong by more than
/// the noise, and hidden states that are free in every window would improve such a fit: losses are
/// then of predictions ahead.
HeldOut held_out_score(const Task& held_out, const Hypothesis& hypothesis,
                       std::span<const double> z, bool noise_is_known);

/// The score with window states that are also fitted from those of another hypothesis and its
/// score. No hypothesis is worse than another because some of its windows ended in local minima.
HeldOut rescored_from(const HeldOut& other, const Hypothesis& other_hypothesis,
                      const Task& held_out, const Hypothesis& hypothesis, std::span<const double> z,
                      const HeldOut& found, bool noise_is_known);

/// The same of windows whose states are fitted already.
HeldOut score_of(const Fit& fitted, const Task& task, const Hypothesis& hypothesis,
                 std::span<const double> z, bool noise_is_known);

/// Loss that `after` saves over all windows, with its standard error over windows [nat]. The prior
/// penalty is left out: it says nothing about the held-out data.
struct ScoreGain {
  double value = 0.0;
  double se = 0.0;
};
ScoreGain score_gain(const HeldOut& before, const HeldOut& after);

/// Significance of a positive mean gain over windows, as the equivalent number of standard
/// deviations of a normal distribution (Student's t converted by Wallace's formula, 1959). Windows
/// are the independent units: samples within one share its state.
double gain_z(const HeldOut& before, const HeldOut& after);

/// Probability of such a mean gain, or a larger one, by chance.
double gain_chance(const HeldOut& before, const HeldOut& after);

/// Probability of a gain over windows at least as large if every window were as likely to lose what
/// it gains (randomisation test: Fisher 1935). Exact whatever the distribution of the gains, of
/// which one that is much larger than the rest hides those from a standard error.
double sign_chance(const HeldOut& before, const HeldOut& after);

/// True if the effect that `after` has and `before` lacks gains more than chance, and decreases
/// chi-squared per sample by more than `least_chi2`, however much is left: each of several effects
/// may take little of the misfit that the others leave.
bool is_gain(const HeldOut& before, const HeldOut& after, bool noise_is_known,
             const Criteria& criteria, double least_chi2);

/// The same for an effect that has to stand by itself: where the recording remains unexplained, any
/// term absorbs a little of what the missing physics leaves, and only a large part counts.
bool is_major_gain(const HeldOut& before, const HeldOut& after, bool noise_is_known,
                   const Criteria& criteria, double least_chi2);

/// Held-out chi-squared per sample up to which a recording is explained.
double explained_chi2(bool noise_is_known, const Criteria& criteria);

}  // namespace stickslip::diagnosis
