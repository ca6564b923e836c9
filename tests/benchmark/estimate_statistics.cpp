// SPDX-License-Identifier: Apache-2.0
#include "tests/benchmark/estimate_statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stickslip::quality {

void RelativeError::add(double estimate, double truth) {
  const double error = estimate - truth;
  error_square_ += std::isfinite(error) ? error * error : std::numeric_limits<double>::infinity();
  truth_square_ += truth * truth;
}

std::optional<double> RelativeError::value() const {
  if (!(truth_square_ > 0.0)) return std::nullopt;
  return std::sqrt(error_square_ / truth_square_);
}

bool covers(double estimate, double standard_deviation, double truth) {
  constexpr double quantile = 1.959963984540054;  // of the normal distribution, 97.5 %
  if (!std::isfinite(standard_deviation)) return false;
  return std::abs(estimate - truth) <= quantile * standard_deviation;  // false for NaN
}

void Coverage::add(double estimate, double standard_deviation, double truth) {
  ++count_;
  if (covers(estimate, standard_deviation, truth)) ++inside_;
}

std::optional<double> Coverage::share() const {
  if (count_ == 0) return std::nullopt;
  return static_cast<double>(inside_) / static_cast<double>(count_);
}

std::optional<double> area_under_curve(std::vector<Scored> samples) {
  for (Scored& each : samples) {
    if (std::isnan(each.score)) each.score = -std::numeric_limits<double>::infinity();
  }
  std::sort(samples.begin(), samples.end(),
            [](const Scored& a, const Scored& b) { return a.score < b.score; });
  double pairs = 0.0;  // won by the positive sample
  double negatives = 0.0;
  double positives = 0.0;
  for (std::size_t begin = 0, end = 0; begin < samples.size(); begin = end) {
    double tied_negatives = 0.0;
    double tied_positives = 0.0;
    for (; end < samples.size() && samples[end].score == samples[begin].score; ++end) {
      (samples[end].positive ? tied_positives : tied_negatives) += 1.0;
    }
    pairs += tied_positives * (negatives + 0.5 * tied_negatives);
    negatives += tied_negatives;
    positives += tied_positives;
  }
  if (negatives == 0.0 || positives == 0.0) return std::nullopt;
  return pairs / (negatives * positives);
}

std::optional<Distribution> distribution_of(const std::vector<std::optional<double>>& values,
                                            Worst worst) {
  std::vector<double> present;
  for (const std::optional<double>& value : values) {
    if (value) present.push_back(*value);
  }
  if (present.empty()) return std::nullopt;
  std::sort(present.begin(), present.end());
  const std::size_t half = present.size() / 2;
  const double median =
      present.size() % 2 == 1 ? present[half] : 0.5 * (present[half - 1] + present[half]);
  return Distribution{median, worst == Worst::largest ? present.back() : present.front(),
                      present.size()};
}

}  // namespace stickslip::quality
