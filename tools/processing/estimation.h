// SPDX-License-Identifier: Apache-2.0
// Smoothed estimates of a recording, as a table and in summary.
#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "observer/smoother.h"
#include "physics/model.h"
#include "physics/result_units.h"
#include "protocol/progress_callback.h"
#include "protocol/recording.h"

namespace stickslip::processing {

/// A column of the table of estimates.
struct EstimateColumn {
  std::string name;    ///< with its unit
  const char* format;  ///< of printf, for its digits
};

/// Time, each quantity that the model has with its standard deviation, slip velocity, probability
/// of sticking, NIS, and whether the estimate is valid (1 or 0). `first`: any estimate of the
/// model.
std::vector<EstimateColumn> columns_of(const observer::FrictionEstimate& first,
                                       const physics::ResultUnits& units);

/// The values of an estimate in those columns, in SI units.
std::vector<double> row_of(const observer::FrictionEstimate& estimate);

/// Statistics of the estimates over a recording.
struct EstimateSummary {
  /// Mean weighted by the inverse variance, and range.
  struct Spread {
    double sum = 0.0, weight = 0.0;
    double low = 0.0, high = 0.0;
    void add(double value, double deviation);
    double mean() const { return weight > 0.0 ? sum / weight : 0.0; }
  };
  Spread mu, gamma;
  std::size_t frames = 0, good = 0;
  double sticking = 0.0;  ///< sum of probabilities over valid estimates
  observer::PredictionQuality predicted;

  void add(const observer::FrictionEstimate& estimate);
  double sticking_share() const;
  double nll_per_reading() const;  ///< negative log-likelihood of a reading
  double nis_per_reading() const;
};

/// Passes the smoothed estimate of every frame to `take`. Throws InputError with the file of the
/// recording or `model_name` where the recording or the model cannot be estimated.
EstimateSummary estimate(const protocol::Recording& recording, const physics::Model& model,
                         const std::string& model_name,
                         const std::function<void(const observer::FrictionEstimate&)>& take,
                         const protocol::ProgressCallback& done = {});

nlohmann::ordered_json summary_json(const EstimateSummary& summary, const physics::Model& model);

}  // namespace stickslip::processing
