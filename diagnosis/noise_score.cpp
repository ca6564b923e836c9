// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/noise_score.h"

#include <array>
#include <cmath>

namespace stickslip::diagnosis {

namespace {

// Sum of the logarithms of the innovations' standard deviations in a window.
double log_scales(const Task& task, std::size_t w) {
  std::array<Whitening, predicted_channels> filter;
  for (std::size_t c = 0; c < predicted_channels; ++c) filter[c] = Whitening(task.colour[c]);
  const Experiment& e = task.experiment(w);
  const Window& window = task.window(w);
  double sum = 0.0;
  for_each_compared(e, window.begin, window.end, [&](std::size_t k, std::size_t c) {
    sum += std::log(task.sigma_of(e, c) / filter[c].next(e.elapsed_s(k)).scale);
  });
  return sum;
}

}  // namespace

double noise_loss(const Task& task, const Hypothesis& hypothesis, std::span<const double> z) {
  FitOptions options;
  options.iterations = 12;
  options.tolerance = 1.0e-3;
  const Fit fitted = fit_states(task, hypothesis, z, options);
  double loss = 0.0;
  for (std::size_t w = 0; w < fitted.chi2.size(); ++w) {
    // Of an outlier, what an outlier counts at most.
    const double chi2 = fitted.chi2[w] * robust_weight(fitted.chi2[w], fitted.count[w]);
    loss += 0.5 * chi2 + log_scales(task, w) + fitted.state_cost[w];
  }
  return loss;
}

}  // namespace stickslip::diagnosis
