// SPDX-License-Identifier: Apache-2.0
// Search for missing physics: adds one effect after the other to the declared model for as long as
// held-out data support it, replaces effects by others that do better beside the rest, and drops
// those that the rest does not need.
#pragma once

#include <algorithm>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/criteria.h"
#include "diagnosis/detection.h"
#include "diagnosis/fitted_candidate.h"
#include "diagnosis/fitting.h"
#include "diagnosis/residual_features.h"
#include "diagnosis/screening.h"

namespace stickslip::diagnosis {

/// A candidate that was fitted on all windows, for the record.
struct Trial {
  std::string id;       ///< name of the effect
  std::string effect;   ///< its id in the catalogue
  int stage = 0;        ///< effects that the model already had beside the declared ones
  double gain_z = 0.0;  ///< mean held-out gain over windows, in its standard errors
  ScoreGain gain;       ///< over the model that it was added to
};

/// A model with its parameters, and what it leaves on the windows that select.
struct SearchStage {
  Hypothesis hypothesis;
  std::vector<double> z;
  double chi2 = 0.0;  ///< per sample
};

/// An effect that was claimed, with the candidates that it was chosen from (itself first); in the
/// end, of several effects, with those that could take its place beside the others.
struct Claim {
  CandidateEffect candidate;
  std::vector<FittedCandidate> rivals;
  SearchStage before;
  SearchStage after;
  ScoreGain gain;  ///< held-out, over the model without it

  /// Decrease of chi-squared per sample.
  double taken() const { return std::max(0.0, before.chi2 - after.chi2); }
};

class Search {
 public:
  using Progress = std::function<void(const std::string& step, double done)>;

  Search(SearchData data, Progress progress)
      : data_(std::move(data)), progress_(std::move(progress)) {}

  void run(const physics::Model& model);

  const SearchData& data() const { return data_; }
  /// The calibrated declared model, and its windows with the weights of its fit.
  const FittedCandidate& declared() const { return declared_; }
  const Task& declared_task() const { return declared_task_; }
  /// The same with all claimed effects.
  const FittedCandidate& result() const { return current_; }
  const std::vector<Claim>& claims() const { return claims_; }
  const std::vector<Trial>& trials() const { return trials_; }
  /// Where nothing was claimed: the model without an addition, and the finalists beside it.
  const std::vector<FittedCandidate>& unclaimed() const { return unclaimed_; }
  /// Relation of the best candidate of the first step, claimed or not.
  std::optional<physics::Relation> relation() const { return relation_; }
  /// True if the result needs calibrated parameters that are implausible.
  bool is_implausible() const {
    return current_.held_out.prior_penalty > data_.criteria.implausible_prior_penalty;
  }
  /// True if the result leaves no more than an explained recording may, where it was selected.
  bool is_explained() const { return is_explained(current_); }
  /// Detection limits beside the result, of listed effects and formulas.
  const Detection& detection();

 private:
  // The fit of all claims but one.
  struct Rest {
    std::size_t dropped = 0;
    FittedCandidate fitted;
  };

  void report(const std::string& step, double share) const;
  std::uint64_t seed() const { return data_.seed + claims_.size(); }
  double least_gain() const;
  double least_gain(const Rest& rest) const;
  bool is_gain(const HeldOut& before, const HeldOut& after, double least_chi2) const {
    return diagnosis::is_gain(before, after, data_.noise_is_known, data_.criteria, least_chi2);
  }
  bool is_gain(const HeldOut& before, const HeldOut& after) const {
    return is_gain(before, after, least_gain());
  }
  bool is_explained(const FittedCandidate& each) const {
    return each.held_out.chi2 <= data_.explained_chi2();
  }

  bool is_major_gain(const HeldOut& before, const HeldOut& after, double least_chi2) const {
    return diagnosis::is_major_gain(before, after, data_.noise_is_known, data_.criteria,
                                    least_chi2);
  }
  bool is_major_gain(const HeldOut& before, const HeldOut& after) const {
    return is_major_gain(before, after, least_gain());
  }

  // Numbers of instruments beyond what the model allows for.
  std::vector<std::size_t> instruments_beyond(const Hypothesis& hypothesis,
                                              std::span<const double> z) const {
    return hypothesis.instruments_beyond(z, data_.criteria.contradicted_sigmas);
  }
  ResidualFeatures features_of(const FittedCandidate& each) const;
  FittedCandidate holding(const FittedCandidate& each,
                          std::span<const std::size_t> parameters) const;
  std::optional<FittedCandidate> with_instruments_held(const FittedCandidate& each) const;
  void set_current(FittedCandidate next);
  void continue_from(const FittedCandidate& next);
  void claim(const FittedCandidate& winner, std::vector<FittedCandidate> rivals);
  void adopt(Claim claim, const FittedCandidate& winner);

  void extend();
  bool may_search() const { return searches_ < data_.criteria.effort.searches; }
  std::vector<FittedCandidate> finalists_beside(const FittedCandidate& base,
                                                const ResidualFeatures& features,
                                                const CandidateFilter& wanted = {});
  bool add_effect();
  void prefer_listed(std::vector<FittedCandidate>& candidates) const;
  bool is_claimable(const FittedCandidate& best) const;
  bool add_contradicted_number(std::vector<FittedCandidate> candidates);
  bool is_contradicted(const FittedCandidate& each) const;
  bool add_effect_beside_current();
  void add_rivals_of_lower_tier(std::vector<FittedCandidate>& candidates);
  std::optional<FittedCandidate> paired(const FittedCandidate& first,
                                        const FittedCandidate& second) const;
  bool add_listed_pair(const std::vector<FittedCandidate>& candidates);
  bool add_with_second(std::vector<FittedCandidate> firsts);
  std::vector<CandidateEffect> contradicted_instruments() const;
  std::optional<FittedCandidate> with_held(const CandidateEffect& effect) const;
  bool add_contradicted_instrument();
  bool add_instrument(const std::vector<CandidateEffect>& own, FittedCandidate held);
  bool contradicts_rig(const FittedCandidate& each) const;
  bool is_complete();
  bool listed_effect_remains();
  void add_trial(const FittedCandidate& each, std::size_t stage, const HeldOut& before);
  void add_differences(std::vector<FittedCandidate>& candidates) const;
  std::vector<FittedCandidate> differing(const FittedCandidate& each) const;
  void share_fit(std::vector<FittedCandidate>& candidates);
  bool improve_from(const FittedCandidate& other);
  void fit_finalists(std::vector<FittedCandidate>& candidates);
  bool is_needless(const FittedCandidate& best) const;

  const std::vector<Rest>& rests();
  void compare_beside_the_others();
  bool swap_effect();
  std::optional<std::pair<FittedCandidate, Claim>> better_in_place_of(const Rest& rest);
  bool is_contradiction(const Claim& claim, const FittedCandidate& without) const;
  // Of the loss without an effect and with it: true if more than the least gain is lost.
  using IsNeeded = bool (Search::*)(const HeldOut& without, const HeldOut& with,
                                    double least_chi2) const;
  bool drop_effect(IsNeeded is_needed);
  std::optional<FittedCandidate> without(std::size_t dropped) const;

  SearchData data_;
  Progress progress_;
  Task declared_task_;
  ResidualFeatures features_;
  std::size_t searches_ = 0;  // of the catalogue, so far
  FittedCandidate declared_;
  FittedCandidate current_;
  std::vector<Claim> claims_;
  // Of the current claims and their fit, once they are needed.
  std::vector<Rest> rests_;
  std::optional<Detection> detection_;
  std::vector<Trial> trials_;
  std::vector<FittedCandidate> unclaimed_;
  std::optional<physics::Relation> relation_;
};

}  // namespace stickslip::diagnosis
