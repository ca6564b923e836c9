// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/noise_estimate.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "diagnosis/parallel/for_each.h"

namespace stickslip::diagnosis {

namespace {

// Windows that the colour is estimated from, spread over the task: tens of thousands of samples are
// enough.
constexpr std::size_t most_windows = 40;
constexpr double longest_correlation_share = 0.25;  // of a window
constexpr double shortest_correlation_periods = 1.0;

struct Sample {
  double time_s = 0.0;
  double residual = 0.0;  // in units of the noise
};

using WindowResiduals = std::vector<Sample>;

// Residuals of one channel, by window.
struct ChannelResiduals {
  std::vector<WindowResiduals> window;
  std::size_t count = 0;
};

// Negative log-likelihood of noise of a colour, and the variance that belongs to it.
struct Likelihood {
  double nats = 0.0;
  double variance = 1.0;
};

Likelihood likelihood_of(const ChannelResiduals& residuals, const NoiseColour& colour,
                         bool level_is_known) {
  double square = 0.0;
  double log_scale = 0.0;
  for (const WindowResiduals& window : residuals.window) {
    Whitening whitening(colour);
    double slow = 0.0;
    for (const Sample& each : window) {
      const Whitening::Step step = whitening.next(each.time_s);
      const double innovation = step.innovation(each.residual, slow);
      square += innovation * innovation;
      log_scale -= std::log(step.scale);
    }
  }
  const auto n = static_cast<double>(residuals.count);
  const double variance = level_is_known ? 1.0 : std::max(square / n, 1.0e-12);
  return {0.5 * square / variance + 0.5 * n * std::log(variance) + log_scale, variance};
}

struct Found {
  NoiseColour colour;
  Likelihood likelihood;
};

// The most probable colour: on a coarse grid of share and correlation time, then around its best.
Found most_probable(const ChannelResiduals& residuals, double shortest_s, double longest_s,
                    bool level_is_known) {
  Found best{{}, likelihood_of(residuals, {}, level_is_known)};
  const auto consider = [&](double share, double correlation_s) {
    const NoiseColour colour{std::clamp(share, 0.02, 0.98),
                             std::clamp(correlation_s, shortest_s, longest_s)};
    const Likelihood found = likelihood_of(residuals, colour, level_is_known);
    if (found.nats < best.likelihood.nats) best = {colour, found};
  };
  constexpr int steps = 6;
  for (int i = 0; i < steps; ++i) {
    const double correlation_s = shortest_s * std::pow(longest_s / shortest_s, i / (steps - 1.0));
    for (const double share : {0.15, 0.35, 0.55, 0.75, 0.92}) consider(share, correlation_s);
  }
  if (best.colour.is_white()) return best;
  double factor = std::pow(longest_s / shortest_s, 0.5 / (steps - 1.0));
  double distance = 0.1;
  for (int i = 0; i < 4; ++i, distance *= 0.5, factor = std::sqrt(factor)) {
    const NoiseColour centre = best.colour;
    for (const double up : {-1.0, 0.0, 1.0}) {
      for (const double longer : {1.0 / factor, 1.0, factor}) {
        consider(centre.share + up * distance, centre.correlation_s * longer);
      }
    }
  }
  return best;
}

std::array<ChannelResiduals, predicted_channels> residuals_by_channel(const Task& task,
                                                                      const Hypothesis& hypothesis,
                                                                      const Fit& fitted) {
  std::array<ChannelResiduals, predicted_channels> out;
  const std::size_t stride = (task.windows.size() + most_windows - 1) / most_windows;
  for (std::size_t w = 0; w < task.windows.size(); w += stride) {
    const Experiment& e = task.experiment(w);
    const Window& window = task.window(w);
    const auto readings = predict(e, window, window.end, hypothesis, fitted.z, fitted.state[w]);
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      WindowResiduals list;
      for (std::size_t k = window.begin; k < window.end; ++k) {
        if (!e.is_compared(k, c)) continue;
        const double r = (readings[k - window.begin][c] - e.reading[k][c]) / task.sigma_of(e, c);
        list.push_back({e.elapsed_s(k), std::isfinite(r) ? r : 0.0});
      }
      out[c].count += list.size();
      if (!list.empty()) out[c].window.push_back(std::move(list));
    }
  }
  return out;
}

}  // namespace

NoiseEstimate noise_in_residuals(const Task& task, const Hypothesis& hypothesis, const Fit& fitted,
                                 bool keeps_declared, const Criteria& criteria) {
  NoiseEstimate out{task.colour, task.sigma};
  if (task.windows.empty()) return out;
  const Experiment& e = task.experiment(0);
  const Window& window = task.window(0);
  const double length_s = e.elapsed_s(window.end - 1) - e.elapsed_s(window.begin);
  const double shortest_s = shortest_correlation_periods * e.period_s;
  const double longest_s = std::max(longest_correlation_share * length_s, 2.0 * shortest_s);
  const auto residuals = residuals_by_channel(task, hypothesis, fitted);
  std::array<bool, predicted_channels> contradicts{};
  parallel::for_each(predicted_channels, task.threads, [&](std::size_t c) {
    if (residuals[c].count < 100) return;
    const double least = criteria.claim_nats();
    bool is_known = e.noise_declared[c];
    Found found = most_probable(residuals[c], shortest_s, longest_s, is_known);
    if (is_known && !keeps_declared) {
      const Found freed = most_probable(residuals[c], shortest_s, longest_s, false);
      is_known = found.likelihood.nats - freed.likelihood.nats < least ||
                 std::abs(std::log(freed.likelihood.variance)) < criteria.confirmed_noise_log;
      if (!is_known) found = freed;
    }
    const Likelihood white = likelihood_of(residuals[c], {}, is_known);
    if (white.nats - found.likelihood.nats < least) found = {{}, white};
    const double present = likelihood_of(residuals[c], task.colour[c], true).nats;
    if (present - found.likelihood.nats < least) return;
    out.colour[c] = found.colour;
    out.sigma[c] *= std::sqrt(found.likelihood.variance);
    contradicts[c] = e.noise_declared[c] && !is_known;
  });
  out.contradicts_declaration =
      std::any_of(contradicts.begin(), contradicts.end(), [](bool each) { return each; });
  return out;
}

}  // namespace stickslip::diagnosis
