// SPDX-License-Identifier: Apache-2.0
// Scores of a model with given parameters on windows that it was not fitted to.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "diagnosis/shooting.h"

namespace stickslip::diagnosis {

struct Score {
  double chi2_per_sample = 0.0;  ///< in each window only the initial state is fitted
  double nll_per_sample = 0.0;
  /// Errors of predictions up to the horizon from states estimated on the data before the window.
  std::array<std::optional<double>, predicted_channels> rmse;
  std::array<std::optional<double>, predicted_channels> nrmse;
  std::vector<double> window_chi2;  ///< sum of squares over the noise variance, by window
  std::vector<int> window_count;
  int states_per_window = 0;
};

/// Scores the windows of `task`; chi-squared is in units of the task's sigma.
Score score(const Task& task, const Hypothesis& hypothesis, std::span<const double> z);

/// Errors of predictions of whole windows from states that were estimated on the data just before
/// them (half a horizon, at least 24 samples), by window of the task. Hidden states that are free
/// in every window do not improve them.
struct PredictionErrors {
  struct Sums {
    std::array<double, predicted_channels> square{};
    std::array<std::size_t, predicted_channels> count{};
  };
  std::vector<Sums> window;  ///< all 0 where no data precede the window
  std::vector<double> chi2;  ///< sum of squares over the task's sigma, by window
  std::vector<int> count;
};
PredictionErrors predict_ahead(const Task& task, const Hypothesis& hypothesis,
                               std::span<const double> z);

/// One simulation from the first usable state to the end: root mean square errors by channel, and
/// the same over the channel's standard deviation. The state is fitted on the first window only.
struct FreeRun {
  std::array<std::optional<double>, predicted_channels> rmse;
  std::array<std::optional<double>, predicted_channels> nrmse;
};
FreeRun free_run(const Task& task, const Hypothesis& hypothesis, std::span<const double> z);

/// The noise of each predicted channel of these experiments, the larger where they differ.
std::array<double, predicted_channels> noise_sigma(std::span<const Experiment> experiments);

}  // namespace stickslip::diagnosis
