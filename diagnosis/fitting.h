// SPDX-License-Identifier: Apache-2.0
// Fits of candidates: in stages, with weights adapted to their residuals, to convergence, and again
// from the declared values.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "diagnosis/criteria.h"
#include "diagnosis/fitted_candidate.h"
#include "diagnosis/shooting.h"
#include "physics/campaign.h"

namespace stickslip::diagnosis {

/// The data of a search: recordings, windows to fit and to hold out, weights.
struct SearchData {
  std::span<const Experiment> experiments;
  Criteria criteria;
  std::uint64_t seed = 1;
  int threads = 1;
  bool noise_is_known = false;  ///< declared, or estimated and confirmed by a fit
  Task train;
  Task held_out;
  /// That the experiments are the recordings of; empty: one model in all of them.
  std::shared_ptr<const physics::Campaign> campaign = nullptr;

  double explained_chi2() const { return diagnosis::explained_chi2(noise_is_known, criteria); }
};

SearchData search_data(std::span<const Experiment> experiments, const Criteria& criteria,
                       std::uint64_t seed, int threads);

/// The windows of the experiments for one use, in units of the noise.
Task task_for(std::span<const Experiment> experiments, Use use, int threads);

/// Fits the beginning of each window first, where even a wrong model still follows the motion, then
/// the whole windows with `options`.
Fit fit_in_stages(const Task& task, const Hypothesis& hypothesis, const std::vector<double>& z,
                  const std::vector<WindowState>& states, const FitOptions& options);

/// The calibration of the declared model: its first fit, weights and score.
FittedCandidate calibrate(SearchData& data, const physics::Model& model);

/// Continues a fit with weights that suit it, and scores it. May confirm the estimated noise.
void settle(SearchData& data, FittedCandidate& each);

/// Fits candidates on all windows, each with its own weights: briefly where another one of its tier
/// is then better beyond Criteria::claim_level over the windows, else to convergence.
void fit_thoroughly(const SearchData& data, std::span<FittedCandidate> candidates);

/// The same, and scores them against `current`. The states of the windows to select on are searched
/// from those of `current`, too: no candidate loses by what that had found.
void fit_and_score(const SearchData& data, const FittedCandidate& current,
                   std::span<FittedCandidate> candidates);

/// True if any of the candidates leaves hardly more than noise.
bool is_near_noise(std::span<const FittedCandidate> candidates, const Criteria& criteria);

/// Refits the best of the candidates that `may_restart`: from the declared values of the model,
/// first guesses of the states and the fitted sizes of the effects, without refinements. Calibrated
/// parameters and refinements that compensate each other may have led the first fit into a local
/// minimum. `declared` is the declared model.
void restart_best(const SearchData& data, const Hypothesis& declared,
                  const FittedCandidate& current, std::span<FittedCandidate> candidates,
                  const std::function<bool(const FittedCandidate&)>& may_restart);

/// Fits `each` again from the parameters and states of `other`, a hypothesis with one effect or
/// free number more or less, and keeps the better fit. True if that is better by more than a nat:
/// `each` was in a local minimum, which `other` gains nothing over.
bool refit_from(const SearchData& data, const FittedCandidate& other, FittedCandidate& each);

}  // namespace stickslip::diagnosis
