// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/noise_floor.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <numeric>
#include <utility>

#include "diagnosis/fourier.h"
#include "diagnosis/median.h"

namespace stickslip::diagnosis {

namespace {

// Of the Kaiser window: a line fills 13 bins, and is 150 dB down outside them. The skirts of lines
// in a shorter window would pass for noise.
constexpr double kaiser_shape = 20.0;
// Bins on each side of a knot whose median is taken, and bins between knots. Lines fill a minority
// of them.
constexpr std::size_t median_bins = 64;
constexpr std::size_t knot_bins = 32;
// A channel with more of its power in noise is no reading of a motion.
constexpr double largest_share = 0.01;

std::vector<double> kaiser_window(std::size_t count) {
  std::vector<double> out(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double x = 2.0 * (static_cast<double>(i) + 0.5) / static_cast<double>(count) - 1.0;
    out[i] = std::cyl_bessel_i(0.0, kaiser_shape * std::sqrt(1.0 - x * x));
  }
  return out;
}

// By bin of 0 to half of the sampling rate, without the mean; 1 for white noise of variance 1.
std::vector<double> power_of(std::span<const double> samples) {
  std::vector<double> windowed = kaiser_window(samples.size());
  double mean = 0.0, weight = 0.0, square = 0.0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    mean += windowed[i] * samples[i];
    weight += windowed[i];
    square += windowed[i] * windowed[i];
  }
  mean /= weight;
  for (std::size_t i = 0; i < samples.size(); ++i) windowed[i] *= samples[i] - mean;
  const auto spectrum = fourier(windowed);
  std::vector<double> out(samples.size() / 2 + 1);
  for (std::size_t k = 0; k < out.size(); ++k) out[k] = std::norm(spectrum[k]) / square;
  return out;
}

// Mean power of noise whose median is that of the bins about a knot.
std::vector<double> continuum_of(const std::vector<double>& power) {
  std::vector<double> out;
  for (std::size_t k = 0; k < power.size(); k += knot_bins) {
    const std::size_t low = k > median_bins ? k - median_bins : 0;
    const std::size_t high = std::min(power.size(), k + median_bins + 1);
    const auto begin = power.begin();
    out.push_back(median({begin + static_cast<std::ptrdiff_t>(low),
                          begin + static_cast<std::ptrdiff_t>(high)}) /
                  std::numbers::ln2);
  }
  return out;
}

}  // namespace

NoiseFloor::NoiseFloor(std::span<const double> samples, double period_s, double noise_std)
    : white_(noise_std * noise_std) {
  if (samples.size() < 4 * median_bins) return;
  const std::vector<double> power = power_of(samples);
  std::vector<double> continuum = continuum_of(power);
  const double noise = std::accumulate(continuum.begin(), continuum.end(), 0.0);
  const double share =
      static_cast<double>(knot_bins) * noise / std::accumulate(power.begin(), power.end(), 0.0);
  if (!(share <= largest_share)) return;
  knots_per_hz_ = static_cast<double>(samples.size()) * period_s / static_cast<double>(knot_bins);
  power_ = std::move(continuum);
}

double NoiseFloor::at(double frequency_hz) const {
  if (power_.empty()) return white_;
  const double last = static_cast<double>(power_.size() - 1);
  const double knot = std::clamp(frequency_hz * knots_per_hz_, 0.0, last);
  const auto low = static_cast<std::size_t>(knot);
  const std::size_t high = std::min(low + 1, power_.size() - 1);
  const double continuum = std::lerp(power_[low], power_[high], knot - static_cast<double>(low));
  return std::max(white_, continuum);
}

}  // namespace stickslip::diagnosis
