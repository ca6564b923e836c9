// SPDX-License-Identifier: Apache-2.0
// Findings of a search: claimed effects with intervals, probabilities, fitted shapes, and the
// experiment that would separate them from their rivals.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diagnosis/candidates.h"
#include "diagnosis/search.h"
#include "diagnosis/shape.h"

namespace stickslip::diagnosis {

struct Estimate {
  std::string name;
  double value = 0.0;
  double low = 0.0;  ///< 95 % interval of the fit
  double high = 0.0;
  /// Standard deviation by which the formula itself may be wrong; no part of the interval.
  double formula_uncertainty = 0.0;
  std::string unit = {};
  bool determined = true;  ///< false: no reading depends on it
};

struct Alternative {
  CandidateEffect candidate;
  double probability = 0.0;
};

/// A candidate that is claimed: one missing effect, or a declared number that is contradicted.
struct Finding : CandidateEffect {
  std::string statement = {};
  std::vector<Estimate> parameters = {};
  std::optional<std::pair<double, double>> when_s = {};  ///< begin and end of an effect that ends
  double probability = 0.0;                              ///< relative to the alternatives tried
  std::vector<Alternative> alternatives = {};
  std::optional<std::string> separating_experiment = {};
  std::vector<Curve> shape = {};     ///< as fitted, over the range of the recording
  std::vector<Curve> portrait = {};  ///< for the reader, with 95 % bands: see portrait_of
  double chi2_before = 0.0;          ///< held-out, without this finding and with it
  double chi2_after = 0.0;
  ScoreGain gain = {};  ///< held-out, over the model without it
  /// Alternatives that score better, which it was preferred to as the simpler or the listed one.
  std::vector<CandidateEffect> preferred_over = {};
};

std::vector<Finding> findings_of(const Search& search, double horizon_s);

/// The fitted parameters of the candidate effect, in the order of its card.
std::vector<Estimate> estimates_of(const FittedCandidate& each);

/// The fitted model; every unknown has its posterior standard deviation, which includes what the
/// formula of an effect may be wrong by, instead of the declared one.
physics::Model posterior_model(const FittedCandidate& each);

/// The same under these conditions of its campaign.
physics::Model posterior_model(const FittedCandidate& each,
                               const std::map<std::string, double>& conditions);

/// 95 % interval of an unknown where its fit has converged; its value alone otherwise.
std::pair<double, double> interval_of(const FittedCandidate& each, std::size_t unknown);

}  // namespace stickslip::diagnosis
