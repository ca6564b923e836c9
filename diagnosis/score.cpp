// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/score.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "diagnosis/parallel/for_each.h"

namespace stickslip::diagnosis {

std::array<double, predicted_channels> noise_sigma(std::span<const Experiment> experiments) {
  std::array<double, predicted_channels> sigma{};
  for (const Experiment& e : experiments) {
    for (std::size_t c = 0; c < predicted_channels; ++c)
      sigma[c] = std::max(sigma[c], e.noise_std[c]);
  }
  for (double& each : sigma) {
    if (!(each > 0.0)) each = 1.0;
  }
  return sigma;
}

namespace {

// The windows just before those of the task, on which the states of predictions are estimated.
std::vector<Experiment> with_preceding_windows(std::span<const Experiment> experiments) {
  std::vector<Experiment> shifted(experiments.begin(), experiments.end());
  for (Experiment& e : shifted) {
    for (Window& window : e.windows) {
      const std::size_t horizon = window.end - window.begin;
      const std::size_t settling = window.begin - window.warm;
      const auto wanted = std::max<std::size_t>(horizon / 2, 24);
      const std::size_t earliest = e.segment_of(window.warm).usable_begin;
      const std::size_t available = window.warm > earliest ? window.warm - earliest : 0;
      const std::size_t before = std::min(wanted, available);
      window.end = window.begin;
      window.begin -= before;
      window.warm = window.begin - settling;
    }
  }
  return shifted;
}

void add_errors(PredictionErrors::Sums& sums, const Experiment& e, std::size_t sample,
                const std::array<double, predicted_channels>& reading) {
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (!e.is_compared(sample, c)) continue;
    const double error = reading[c] - e.reading[sample][c];
    sums.square[c] += error * error;
    ++sums.count[c];
  }
}

template <class Result>
void set_errors(const PredictionErrors::Sums& sums, std::span<const Experiment> experiments,
                Result& out) {
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (sums.count[c] == 0) continue;
    double spread = 0.0;
    for (const Experiment& e : experiments) spread = std::max(spread, e.channel_std[c]);
    const double rms = std::sqrt(sums.square[c] / static_cast<double>(sums.count[c]));
    // A model that diverges has no finite error; a report holds finite numbers only.
    out.rmse[c] = std::isfinite(rms) ? std::min(rms, 1.0e6) : 1.0e6;
    out.nrmse[c] = spread > 0.0 ? std::min(*out.rmse[c] / spread, 1.0e6) : 0.0;
  }
}

}  // namespace

Score score(const Task& task, const Hypothesis& hypothesis, std::span<const double> z) {
  Score out;
  FitOptions states_only;
  states_only.parameters_free = false;
  states_only.iterations = 12;
  const Fit fitted = fit_states(task, hypothesis, z, states_only);
  out.window_chi2 = fitted.chi2;
  out.window_count = fitted.count;
  out.states_per_window = fitted.states_per_window;
  out.chi2_per_sample = std::min(fitted.chi2_per_sample(), 1.0e12);

  double log_sigma = 0.0;
  double channels = 0.0;
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    const bool compared = std::any_of(task.experiments.begin(), task.experiments.end(),
                                      [c](const Experiment& e) { return e.is_compared(c); });
    if (!compared) continue;
    log_sigma += std::log(task.sigma[c]);
    channels += 1.0;
  }
  out.nll_per_sample = 0.5 * out.chi2_per_sample + 0.5 * std::log(2.0 * std::numbers::pi) +
                       (channels > 0.0 ? log_sigma / channels : 0.0);

  PredictionErrors::Sums all;
  for (const PredictionErrors::Sums& each : predict_ahead(task, hypothesis, z).window) {
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      all.square[c] += each.square[c];
      all.count[c] += each.count[c];
    }
  }
  set_errors(all, task.experiments, out);
  return out;
}

PredictionErrors predict_ahead(const Task& task, const Hypothesis& hypothesis,
                               std::span<const double> z) {
  const std::vector<Experiment> preceding = with_preceding_windows(task.experiments);
  Task estimate = task;
  estimate.experiments = preceding;
  FitOptions states_only;
  states_only.parameters_free = false;
  states_only.iterations = 12;
  const Fit states = fit(estimate, hypothesis, {z.begin(), z.end()},
                         initial_states(estimate, hypothesis), states_only);
  PredictionErrors out;
  out.window.resize(task.windows.size());
  out.chi2.assign(task.windows.size(), 0.0);
  out.count.assign(task.windows.size(), 0);
  parallel::for_each(task.windows.size(), task.threads, [&](std::size_t w) {
    const WindowRef ref = task.windows[w];
    const Experiment& e = preceding[ref.experiment];
    const Window& window = e.windows[ref.window];
    if (window.end - window.begin < 8) return;  // too close to the beginning of the recording
    const Window& ahead = task.experiments[ref.experiment].windows[ref.window];
    const auto readings = predict(e, window, ahead.end, hypothesis, z, states.state[w]);
    for (std::size_t k = ahead.begin; k < ahead.end; ++k) {
      add_errors(out.window[w], e, k, readings[k - window.begin]);
    }
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      out.chi2[w] += out.window[w].square[c] / (task.sigma_of(e, c) * task.sigma_of(e, c));
      out.count[w] += static_cast<int>(out.window[w].count[c]);
    }
    if (!std::isfinite(out.chi2[w])) out.chi2[w] = 1.0e30;
  });
  return out;
}

FreeRun free_run(const Task& task, const Hypothesis& hypothesis, std::span<const double> z) {
  FreeRun out;
  Task first = task;
  first.windows.clear();
  for (std::size_t i = 0; i < task.experiments.size(); ++i) {
    const Experiment& e = task.experiments[i];
    const Segment longest = e.longest_segment();
    const auto window = std::find_if(e.windows.begin(), e.windows.end(), [&](const Window& each) {
      return each.warm >= longest.begin;
    });
    if (window == e.windows.end() || window->end > longest.end) continue;
    first.windows.push_back({i, static_cast<std::size_t>(window - e.windows.begin())});
  }
  FitOptions states_only;
  states_only.parameters_free = false;
  const Fit fitted =
      fit(first, hypothesis, {z.begin(), z.end()}, initial_states(first, hypothesis), states_only);
  PredictionErrors::Sums sums;
  for (std::size_t w = 0; w < first.windows.size(); ++w) {
    const Experiment& e = task.experiments[first.windows[w].experiment];
    const Window& window = first.window(w);
    const std::size_t end = e.segment_of(window.begin).usable_end;
    const auto readings = predict(e, window, end, hypothesis, z, fitted.state[w]);
    for (std::size_t k = window.begin; k < end; ++k)
      add_errors(sums, e, k, readings[k - window.begin]);
  }
  set_errors(sums, task.experiments, out);
  return out;
}

}  // namespace stickslip::diagnosis
