// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/noise_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "diagnosis/median.h"

namespace stickslip::diagnosis {

namespace {

constexpr double certain = 3.0;  // standard deviations

// Mean and median of a quantity over windows, and the standard deviation of the mean. The scatter
// is that of the middle windows: a window that fails must not hide behind its own failure.
struct OverWindows {
  double mean = 0.0;
  double middle = 0.0;
  double error = 0.0;
};

OverWindows over_windows(const std::vector<double>& values) {
  OverWindows out;
  if (values.empty()) return out;
  const auto n = static_cast<double>(values.size());
  for (const double each : values) out.mean += each / n;
  out.middle = median(values);
  std::vector<double> off;
  for (const double each : values) off.push_back(std::abs(each - out.middle));
  constexpr double normal = 1.4826;  // standard deviation over median absolute deviation
  out.error = normal * median(std::move(off)) / std::sqrt(n);
  return out;
}

// Mean squares of the scaled residuals of one channel, and correlation of neighbouring samples, by
// window; and the innovations, by window and sample, 0 where none is compared.
struct ChannelResiduals {
  std::vector<double> square;
  std::vector<double> correlation;
  std::vector<std::vector<double>> innovations;
};

using ByChannel = std::array<ChannelResiduals, predicted_channels>;

void add_window(const Task& task, std::size_t w, const Readings& readings, double freedom,
                ByChannel& out) {
  const Experiment& e = task.experiment(w);
  const Window& window = task.window(w);
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    double square = 0.0;
    double product = 0.0;
    double former = 0.0;
    double samples = 0.0;
    double slow = 0.0;
    std::vector<double>& innovations = out[c].innovations.emplace_back(window.end - window.begin);
    Whitening whitening(task.colour[c]);
    for (std::size_t k = window.begin; k < window.end; ++k) {
      if (!e.is_compared(k, c)) continue;
      const double off = (readings[k - window.begin][c] - e.reading[k][c]) / task.sigma_of(e, c);
      const double r = whitening.next(e.elapsed_s(k)).innovation(off, slow);
      square += r * r;
      product += former * r;
      former = r;
      innovations[k - window.begin] = std::isfinite(r) ? r : 0.0;
      samples += 1.0;
    }
    if (!(samples > 0.0) || !(square > 0.0) || !std::isfinite(square)) continue;
    out[c].square.push_back(square / (freedom * samples));
    out[c].correlation.push_back(product / square);
  }
}

ByChannel channel_residuals(const Task& task, const Hypothesis& hypothesis,
                            std::span<const double> z, const Fit& fitted) {
  ByChannel out;
  for (std::size_t w = 0; w < task.windows.size(); ++w) {
    const Window& window = task.window(w);
    const auto readings =
        predict(task.experiment(w), window, window.end, hypothesis, z, fitted.state[w]);
    const double samples = std::max(1, fitted.count[w]);
    add_window(task, w, readings, std::max(1.0, samples - fitted.states_per_window) / samples, out);
  }
  return out;
}

// True if all windows have the same level but for chance. The mean of a chi-squared exceeds its
// median (Wilson and Hilferty).
bool is_alike(const OverWindows& level, double freedom) {
  const double skew = std::pow(1.0 - 2.0 / (9.0 * std::max(freedom, 1.0)), 3);
  return level.mean - level.middle / skew < certain * std::sqrt(2.5) * level.error;
}

// True if the levels scatter over the windows by no more than chi-squared does, but for chance.
// Those of a misfit scatter by more: their mean is then as uncertain as it is wrong.
bool scatters_as_noise(const OverWindows& level, double chance, double windows) {
  constexpr double error_of_scatter = 1.167;  // of the median absolute deviation, times sqrt(n)
  return level.error < chance * (1.0 + certain * error_of_scatter / std::sqrt(windows));
}

// Sum of the products of two channels' innovations, those of the second `lag` samples later.
double lagged_product(const ChannelResiduals& a, const ChannelResiduals& b, std::size_t lag) {
  double sum = 0.0;
  for (std::size_t w = 0; w < a.innovations.size(); ++w) {
    const auto& first = a.innovations[w];
    const auto& second = b.innovations[w];
    if (second.size() <= lag) continue;
    sum += std::inner_product(second.begin() + static_cast<std::ptrdiff_t>(lag), second.end(),
                              first.begin(), 0.0);
  }
  return sum;
}

// Products of a channel's innovations with its own, by lag up to half of the longest window.
std::vector<double> own_products(const ChannelResiduals& each) {
  std::size_t longest = 0;
  for (const auto& window : each.innovations) longest = std::max(longest, window.size());
  std::vector<double> out;
  for (std::size_t lag = 0; lag <= longest / 2; ++lag) {
    out.push_back(lagged_product(each, each, lag));
  }
  return out;
}

// True if a part of both channels that is not negligible follows one cause: instruments have noise
// of their own, whatever its colour, and missing physics moves all of them. Up to a delay of
// half a window, since a velocity is a quarter of a period ahead of its displacement. Innovations
// that are not white correlate by chance as fewer samples do (Bartlett's formula).
bool share_a_cause(const ChannelResiduals& a, std::span<const double> own_a,
                   const ChannelResiduals& b, std::span<const double> own_b,
                   const Criteria& criteria) {
  const double squares = own_a[0] * own_b[0];
  if (!(squares > 0.0)) return false;
  double most = 0.0;
  double follow = 1.0;  // samples that carry the information of one
  for (std::size_t lag = 0; lag < own_a.size(); ++lag) {
    const double ahead = lagged_product(a, b, lag);
    const double behind = lagged_product(b, a, lag);
    most = std::max({most, ahead * ahead, behind * behind});
    if (lag > 0) follow += 2.0 * own_a[lag] * own_b[lag] / squares;
  }
  std::size_t samples = 0;
  for (const auto& window : a.innovations) samples += window.size();
  const double shared = most / squares;
  return shared > criteria.negligible_share &&
         0.5 * shared * static_cast<double>(samples) / std::max(1.0, follow) >
             criteria.claim_nats();
}

bool any_share_a_cause(const ByChannel& residuals, const Criteria& criteria) {
  std::array<std::vector<double>, predicted_channels> own;
  std::ranges::transform(residuals, own.begin(), own_products);
  for (std::size_t c = 0; c < residuals.size(); ++c) {
    for (std::size_t d = c + 1; d < residuals.size(); ++d) {
      if (share_a_cause(residuals[c], own[c], residuals[d], own[d], criteria)) return true;
    }
  }
  return false;
}

}  // namespace

NoiseCheck noise_check(const Task& task, const Hypothesis& hypothesis, std::span<const double> z,
                       bool estimated, const Criteria& criteria) {
  FitOptions options;
  options.iterations = 12;
  const Fit fitted = fit_states(task, hypothesis, z, options);
  std::vector<double> by_window;
  double all_freedom = 0.0;
  for (std::size_t w = 0; w < fitted.chi2.size(); ++w) {
    const double freedom = std::max(1, fitted.count[w] - fitted.states_per_window);
    by_window.push_back(fitted.chi2[w] / freedom);
    all_freedom += freedom;
  }
  if (by_window.empty()) return {};
  const OverWindows level = over_windows(by_window);
  const double windows = static_cast<double>(by_window.size());
  const double off = fitted.chi2_per_sample() - 1.0;
  const double of_level = estimated ? std::expm1(criteria.confirmed_noise_log) : 0.0;
  const double of_noise = std::sqrt(2.0 / all_freedom);
  const double chance = std::max(level.error, of_noise);
  const bool is_expected = std::abs(off) <= certain * chance + of_level;
  const bool is_above = off > 0.0 && !is_expected;
  const bool alike = is_alike(level, all_freedom / windows);
  if (is_above && !alike) return {};
  const ByChannel residuals = channel_residuals(task, hypothesis, z, fitted);
  if (is_above && any_share_a_cause(residuals, criteria)) return {};
  NoiseCheck out;
  out.is_expected_noise = is_expected && alike && scatters_as_noise(level, of_noise, windows) &&
                          !any_share_a_cause(residuals, criteria);
  for (const Channel channel : all_channels) {
    if (index_of(channel) >= predicted_channels) continue;
    const ChannelResiduals& each = residuals[index_of(channel)];
    if (each.square.empty()) continue;
    const OverWindows correlation = over_windows(each.correlation);
    const bool is_white = correlation.mean <= certain * correlation.error;
    if (is_above && !is_white) return {};
    out.is_expected_noise = out.is_expected_noise && is_white;
    const OverWindows square = over_windows(each.square);
    const bool differs =
        !is_expected && std::abs(square.mean - 1.0) > certain * square.error + of_level;
    out.level.push_back({channel, std::sqrt(square.mean), differs});
  }
  out.is_noise = true;
  return out;
}

}  // namespace stickslip::diagnosis
