// SPDX-License-Identifier: Apache-2.0
// Comparison of the recordings of a campaign: each number estimated by every recording for itself,
// beside all others as they are.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/fitting.h"
#include "diagnosis/heterogeneity.h"
#include "physics/campaign.h"

namespace stickslip::diagnosis {

/// Value of a number in one recording, by that recording.
struct OwnValue {
  std::size_t recording = 0;
  double value = 0.0;
  double low = 0.0;  ///< 95 % interval
  double high = 0.0;
  bool disagrees = false;
};

/// Change of a number with a condition.
struct Trend {
  double value = 0.0;  ///< coefficient, exponent, or change by unit or e-fold of the condition
  double low = 0.0;    ///< 95 % interval
  double high = 0.0;
  bool exponent = false;  ///< the number is a power of the condition
};

struct Comparison {
  physics::SharedNumber number;
  std::string unit;
  double value = 0.0;  ///< as fitted to all: common, mean, or at the reference of its condition
  double low = 0.0;    ///< 95 % interval
  double high = 0.0;
  std::vector<OwnValue> own;  ///< of the recordings that take part in the fit
  double q = 0.0;             ///< Cochran's Q of the own values about the one that they share
  int freedom = 0;
  double p = 1.0;
  bool tenable = true;  ///< the shared value is, among all comparisons (Holm, 5 %)
  std::optional<Trend> trend;
  /// Standard deviation of the values over the recordings, in their unit, with its interval.
  std::optional<Spread> spread;
};

/// A number freed in every recording, beside a fit.
struct OwnFit {
  OwnEstimates estimates;  ///< of its value, or of the logarithm
  bool logarithmic = false;
  double centre = 1.0;  ///< of which the logarithm is that of the ratio
  std::vector<std::size_t> recording;
  std::vector<OwnValue> value;
};

/// None where fewer than two recordings determine the number.
std::optional<OwnFit> own_fit(const SearchData& data, const FittedCandidate& result,
                              const std::string& path);

/// The result with the spreads of all numbers that vary at their most probable values.
void estimate_spreads(SearchData& data, FittedCandidate& result);

/// Every number of the result that the recordings could disagree about: those of terms on trial,
/// and the calibrated ones.
std::vector<Comparison> comparisons_of(const SearchData& data, const FittedCandidate& result);

}  // namespace stickslip::diagnosis
