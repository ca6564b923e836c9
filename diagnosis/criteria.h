// SPDX-License-Identifier: Apache-2.0
// Thresholds of a diagnosis: every number that decides what is claimed, preferred, reported or left
// out, and how much work is spent before that is decided.
//
// One rate of false alarms decides when a gain may be chance. Unless a line says otherwise, every
// other default was set by hand on concealed recordings made during development, so that recordings
// of consistent rigs are not reported as missing physics. `nat`: unit of the natural logarithm of a
// likelihood.
#pragma once

#include <cmath>
#include <cstddef>
#include <string>

namespace stickslip::diagnosis {

/// Work spent on candidates. More costs time; less risks a wrong choice of finalists.
struct Effort {
  /// Windows of a rough fit: half spread over the recording, half where the base model fits worst.
  std::size_t screening_windows = 20;
  /// More of them for each further recording of a campaign, whose own numbers they have to show.
  std::size_t screening_windows_of_recording = 8;
  /// Of the first fit of candidates without a first step (FirstSteps), from every start.
  int screening_iterations = 1;
  std::size_t rough_fits = 16;  ///< candidates fitted again after screening, the best first
  int rough_iterations = 2;
  std::size_t refinements = 9;  ///< candidates refined after the rough fits, the best first
  int refinement_iterations = 4;
  std::size_t listed_finalists = 5;    ///< listed effects fitted on all windows
  std::size_t unlisted_finalists = 2;  ///< formulas and drawn shapes fitted on all windows
  std::size_t rough_numbers = 4;       ///< declared numbers fitted again after screening
  std::size_t number_finalists = 2;    ///< declared numbers fitted on all windows
  std::size_t restarts = 2;            ///< finalists refitted from the declared values
  std::size_t most_effects = 6;        ///< effects at once
  /// Of the catalogue, for another effect or for one in place of a claimed one: what no more of
  /// them explain is unexplained.
  std::size_t searches = 6;
  std::size_t bootstrap_draws = 2000;        ///< of held-out windows, for probabilities
  std::size_t region_bootstrap_draws = 400;  ///< of windows, for the error of a region's contrast
  int detection_evaluations = 7;             ///< sizes tried for one detection limit
  double separation_run_s = 12.0;            ///< longest simulated run of a separating experiment
  std::size_t separation_windows = 12;  ///< windows of it that the wrong hypothesis is fitted to
};

struct Criteria {
  // --- When a model explains a recording -------------------------------------------------------
  /// Held-out chi-squared per sample up to which the recording is explained; noise declared, or
  /// estimated and confirmed.
  double explained_chi2 = 1.3;
  /// The same while the noise is only an estimate.
  double explained_chi2_estimated_noise = 3.0;
  /// Share that is negligible, since no model of a real machine is exact: of the excess chi-squared
  /// (above 1), which findings may leave and still explain the recording; of what an effect gains
  /// in some windows, which it may lose in others; of a gain, by which a simpler effect is behind.
  double negligible_share = 0.1;
  /// Prior penalty [nat] of the calibrated parameters (half the sum of squares of their distances
  /// from the declared values in standard deviations) above which the calibration is implausible.
  /// Nine parameters that follow their priors exceed it once in 100000 recordings. Effects are then
  /// screened beside the declared values, too.
  double implausible_prior_penalty = 20.0;
  /// Distance of a typical window's log chi-squared per sample from 0 up to which an estimate of
  /// the noise is confirmed by the fit: anything but noise would leave more.
  double confirmed_noise_log = 0.2;
  /// Factor between residual and estimated noise, in every channel, below which the last steps of a
  /// fit weigh the channels by the estimate.
  double near_noise_factor = 3.0;

  // --- When an effect is claimed ---------------------------------------------------------------
  /// Share of the recordings of consistent rigs in which an effect may be claimed by chance.
  double false_alarm_rate = 0.01;
  /// Share of the excess chi-squared (at least 1) that effects have to remove each where all of
  /// them together do not explain the recording: any term absorbs a little of what another effect
  /// leaves.
  double claim_share_unexplained = 0.3;
  /// Distance of a calibrated parameter from its declared value [declared standard deviations]
  /// above which the declaration is contradicted.
  double contradicted_sigmas = 3.0;
  /// Standard deviation of the logarithm of a parameter above which the recording does not
  /// determine it (its prior has 4), and the effect is not a candidate.
  double undetermined_log_std = 2.5;

  // --- When the search goes on -----------------------------------------------------------------
  /// Held-out chi-squared per sample below which nothing further is searched.
  double noise_floor_chi2 = 1.1;
  /// Where fitted parameters are farther than this from those followed last [standard deviations],
  /// a live check searches beside the latter, too.
  double distant_calibration = 2.0;

  // --- Which of several effects is preferred ---------------------------------------------------
  /// A simpler effect is preferred to one that scores better by fewer standard errors than this,
  /// and by no more than `negligible_share` of the gain: what has more parameters or states
  /// imitates it. A listed effect is preferred to a formula, a formula to a drawn shape, where it
  /// is behind by no more than chance or than what its formula may leave (Card::formula_residual).
  double preference_errors = 2.0;
  /// Complexity [nat] added for an effect that the catalogue does not list.
  double unlisted_complexity = 3.0;
  /// Complexity [nat] added for a number or instrument that is not as declared: where a force and
  /// the zero of its channel explain the same, it is the force.
  double contradiction_complexity = 0.5;

  // --- What is reported ------------------------------------------------------------------------
  /// Decrease of chi-squared per sample by an effect at its detection limit: a short recording
  /// shows it in every window.
  double detection_chi2 = 0.05;
  /// Probability of a finding below which the separating experiment is looked for.
  double certain_probability = 0.95;
  double least_alternative_probability = 0.005;  ///< of an alternative that is listed
  /// Cosine of the angle between two effects' changes of the readings from which the recording
  /// cannot separate them.
  double inseparable_cosine = 0.98;
  /// Excess chi-squared per sample of the wrong hypothesis from which a separating run is proposed,
  double separating_chi2 = 0.1;
  /// and its ratio to that in a repetition of the recorded run.
  double separating_ratio = 3.0;

  // --- Location --------------------------------------------------------------------------------
  /// Share of windows that fail from which the mismatch is throughout the recording.
  double throughout_share = 0.6;
  /// Share of the residual energy that is cut off at each end of a located range.
  double located_tail_share = 0.1;
  /// Gap between failing windows, in windows, below which they are one interval.
  double joined_gap_windows = 2.5;
  /// Expected share of false regions among the reported ones (Benjamini and Yekutieli).
  double region_false_discovery_rate = 0.05;
  double region_least_count = 30.0;  ///< samples or spectral lines inside and outside a region

  // --- Remarks on a recording, for its reader only ---------------------------------------------
  double remark_clipped_percent = 0.1;  ///< of samples at the lowest or highest value
  double remark_jitter = 0.2;           ///< departure from a uniform grid [sampling periods]
  double remark_steps = 1000.0;      ///< quantisation steps in a channel's range, fewer are coarse
  double remark_delay_errors = 5.0;  ///< delay of the velocity [standard errors] and
  double remark_delay_periods = 0.05;  ///< [sampling periods]

  Effort effort;

  /// Probability by chance below which the gain of one effect is claimed: the rate shared among the
  /// effects of the catalogue, of which about twenty change readings in ways of their own.
  double claim_level() const { return false_alarm_rate / 20.0; }
  /// Gain [nat] that a true hypothesis loses to a rival, on data to which neither is fitted, less
  /// often than claim_level: a likelihood ratio has a mean of 1 there (Markov's inequality).
  double claim_nats() const { return -std::log(claim_level()); }
};

/// A sentence that names the first value outside its range; empty for valid criteria.
std::string invalid(const Criteria& criteria);

}  // namespace stickslip::diagnosis
