// SPDX-License-Identifier: Apache-2.0
#include "tools/commissioning/delay_fit.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <tuple>
#include <utility>

namespace stickslip::commissioning {

namespace {

constexpr std::size_t fewest_readings = 30;
constexpr int grid = 200;              // of delays on either side of 0
constexpr double rate_span_s = 0.004;  // over which a rate is taken

double value_at(const TimedReadings& readings, double time_s) {
  const auto above = std::lower_bound(readings.time_s.begin(), readings.time_s.end(), time_s);
  if (above == readings.time_s.begin()) return readings.value.front();
  if (above == readings.time_s.end()) return readings.value.back();
  const auto i = static_cast<std::size_t>(above - readings.time_s.begin());
  const double step_s = readings.time_s[i] - readings.time_s[i - 1];
  const double share = step_s > 0.0 ? (time_s - readings.time_s[i - 1]) / step_s : 0.0;
  return readings.value[i - 1] + share * (readings.value[i] - readings.value[i - 1]);
}

double followed_at(const TimedReadings& reference, Follows follows, double time_s) {
  if (follows == Follows::value) return value_at(reference, time_s);
  return (value_at(reference, time_s + rate_span_s) - value_at(reference, time_s - rate_span_s)) /
         (2.0 * rate_span_s);
}

struct Fit {
  double squares = 0.0;   // of the residuals
  double variance = 0.0;  // of the channel, times the number of readings
  double lag_one = 0.0;   // correlation of successive residuals
};

/// Straight line of the channel over the reference at one delay.
Fit fit_at(const TimedReadings& channel, const TimedReadings& reference, Follows follows,
           double delay_s) {
  const auto n = static_cast<double>(channel.value.size());
  std::vector<double> x(channel.value.size());
  double mean_x = 0.0;
  double mean_y = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    x[i] = followed_at(reference, follows, channel.time_s[i] - delay_s);
    mean_x += x[i] / n;
    mean_y += channel.value[i] / n;
  }
  double xx = 0.0;
  double xy = 0.0;
  Fit out;
  for (std::size_t i = 0; i < x.size(); ++i) {
    xx += (x[i] - mean_x) * (x[i] - mean_x);
    xy += (x[i] - mean_x) * (channel.value[i] - mean_y);
    out.variance += (channel.value[i] - mean_y) * (channel.value[i] - mean_y);
  }
  const double slope = xx > 0.0 ? xy / xx : 0.0;
  double before = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double residual = channel.value[i] - mean_y - slope * (x[i] - mean_x);
    out.squares += residual * residual;
    out.lag_one += residual * before;
    before = residual;
  }
  out.lag_one = out.squares > 0.0 ? out.lag_one / out.squares : 0.0;
  return out;
}

/// The readings whose reference is known at every delay that is tried.
TimedReadings inner(const TimedReadings& channel, const TimedReadings& reference, double margin_s) {
  TimedReadings out;
  if (reference.time_s.empty()) return out;
  for (std::size_t i = 0; i < channel.time_s.size(); ++i) {
    if (channel.time_s[i] < reference.time_s.front() + margin_s) continue;
    if (channel.time_s[i] > reference.time_s.back() - margin_s) continue;
    out.time_s.push_back(channel.time_s[i]);
    out.value.push_back(channel.value[i]);
  }
  return out;
}

}  // namespace

std::optional<Delay> delay_of(const TimedReadings& channel, const TimedReadings& reference,
                              Follows follows, double longest_s) {
  const TimedReadings used = inner(channel, reference, longest_s + 2.0 * rate_span_s);
  if (used.value.size() < fewest_readings) return std::nullopt;
  const double step_s = longest_s / grid;
  const auto squares = [&](double delay_s) {
    return fit_at(used, reference, follows, delay_s).squares;
  };
  double best_s = 0.0;
  double least = squares(0.0);
  for (int i = -grid; i <= grid; ++i) {
    const double here = squares(i * step_s);
    if (here < least) std::tie(least, best_s) = std::pair(here, i * step_s);
  }
  // A parabola through the best one and its neighbours.
  const double left = squares(best_s - step_s);
  const double right = squares(best_s + step_s);
  const double curvature = (left - 2.0 * least + right) / (step_s * step_s);
  if (!(curvature > 0.0)) return std::nullopt;
  const double shift_s = std::clamp(0.5 * (left - right) / (curvature * step_s), -step_s, step_s);
  const Fit fit = fit_at(used, reference, follows, best_s + shift_s);
  if (!(fit.variance > 0.0)) return std::nullopt;
  const auto n = static_cast<double>(used.value.size());
  const double correlation = std::clamp(fit.lag_one, 0.0, 0.99);
  const double noise = fit.squares / (n - 3.0) * (1.0 + correlation) / (1.0 - correlation);
  return Delay{best_s + shift_s, std::sqrt(2.0 * noise / curvature),
               1.0 - fit.squares / fit.variance};
}

}  // namespace stickslip::commissioning
