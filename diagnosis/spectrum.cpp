// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/spectrum.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>

#include "diagnosis/fourier.h"
#include "diagnosis/median.h"

namespace stickslip::diagnosis {

namespace {

using std::numbers::pi;
using Complex = std::complex<double>;

}  // namespace

std::vector<Complex> spectrum_of(std::vector<double> values) {
  std::size_t length = 1;  // lengths with large prime factors are slow to transform
  while (length < values.size()) length *= 2;
  values.resize(length, 0.0);
  return fourier(values);
}

std::vector<Complex> windowed_spectrum(std::vector<double> values) {
  double mean = 0.0;
  for (const double v : values) mean += v;
  mean /= static_cast<double>(values.size());
  for (std::size_t k = 0; k < values.size(); ++k) {
    const double phase =
        2.0 * pi * (static_cast<double>(k) + 0.5) / static_cast<double>(values.size());
    values[k] = (values[k] - mean) * 0.5 * (1.0 - std::cos(phase));
  }
  std::vector<Complex> spectrum = spectrum_of(std::move(values));
  spectrum.resize(spectrum.size() / 2);
  return spectrum;
}

namespace {

// Amplitude and phase of values[k] at one frequency, under a Hann window.
class HannAmplitude {
 public:
  HannAmplitude(const std::vector<double>& values, double period_s)
      : values_(values), period_s_(period_s) {
    for (const double v : values) mean_ += v / static_cast<double>(values.size());
  }
  Complex at(double hz) const {
    // The mean of the window is 1/2, and half of a sine's amplitude is at -hz.
    Complex sum = 0.0;
    Complex turn = 1.0;
    const Complex each = std::polar(1.0, -2.0 * pi * hz * period_s_);
    for (std::size_t k = 0; k < values_.size(); ++k, turn *= each) {
      const double phase =
          2.0 * pi * (static_cast<double>(k) + 0.5) / static_cast<double>(values_.size());
      sum += (values_[k] - mean_) * (1.0 - std::cos(phase)) * turn;
    }
    return 2.0 * sum / static_cast<double>(values_.size());
  }

 private:
  const std::vector<double>& values_;
  double period_s_;
  double mean_ = 0.0;
};

// The line near `frequency_hz`, by golden-section search between the neighbouring bins.
physics::Line refined_line(const std::vector<double>& values, double period_s, double frequency_hz,
                           double step_hz) {
  const HannAmplitude amplitude(values, period_s);
  double low = frequency_hz - step_hz;
  double high = frequency_hz + step_hz;
  constexpr double golden = 0.381966;
  for (int i = 0; i < 24; ++i) {
    const double left = low + golden * (high - low);
    const double right = high - golden * (high - low);
    if (std::abs(amplitude.at(left)) < std::abs(amplitude.at(right))) {
      low = left;
    } else {
      high = right;
    }
  }
  physics::Line line;
  line.frequency_hz = 0.5 * (low + high);
  const Complex found = amplitude.at(line.frequency_hz);
  line.amplitude = std::abs(found);
  line.phase_rad = std::arg(found) + 0.5 * pi;  // a sine, not a cosine
  return line;
}

// Power of a line over that of its surroundings. The power of noise is exponentially distributed:
// e^-20 allows for every bin, line and channel that is examined.
constexpr double significant_power = 20.0;

constexpr std::array mains_hz = {50.0, 100.0, 150.0, 60.0, 120.0, 180.0};

// The bin of a significant line near `centre_hz`, where a line of `mains` Hz appears.
std::optional<std::size_t> significant_bin(const std::vector<Complex>& spectrum, double step_hz,
                                           double resolution_hz, double centre_hz, double mains) {
  const double searched = mains_deviation * mains;
  const double around = searched + 12.0 * resolution_hz;
  const auto bin = [&](double hz) {
    return static_cast<std::ptrdiff_t>(std::lround(hz / step_hz));
  };
  const std::ptrdiff_t first = bin(centre_hz - around);
  const std::ptrdiff_t last = bin(centre_hz + around);
  if (first < 1 || last >= static_cast<std::ptrdiff_t>(spectrum.size())) return std::nullopt;
  const auto power = [&](std::ptrdiff_t i) {
    return std::norm(spectrum[static_cast<std::size_t>(i)]);
  };
  std::ptrdiff_t top = bin(centre_hz - searched);
  for (std::ptrdiff_t i = top; i <= bin(centre_hz + searched); ++i) {
    if (power(i) > power(top)) top = i;
  }
  std::vector<double> surroundings;
  const std::ptrdiff_t own = bin(3.0 * resolution_hz);
  for (std::ptrdiff_t i = first; i <= last; ++i) {
    if (std::abs(i - top) > own) surroundings.push_back(power(i));
  }
  if (surroundings.size() < 8) return std::nullopt;
  const double mean = median(std::move(surroundings)) / std::numbers::ln2;
  if (power(top) < significant_power * mean) return std::nullopt;
  return static_cast<std::size_t>(top);
}

// Band beside a lone line [Hz], and its power over that of any other in it.
constexpr double lone_band_hz = 4.0;
constexpr double lone_power = 4.0;
// An alias below this multiple of the strongest line may be an overtone of the motion.
constexpr double above_motion = 3.0;

bool is_lone(const std::vector<Complex>& spectrum, double step_hz, double resolution_hz,
             std::size_t line) {
  const auto own = static_cast<std::size_t>(3.0 * resolution_hz / step_hz) + 1;
  const auto band = static_cast<std::size_t>(lone_band_hz / step_hz);
  const std::size_t last = std::min(line + band, spectrum.size() - 1);
  double other = 0.0;
  for (std::size_t i = line > band ? line - band : 1; i <= last; ++i) {
    if (i + own < line || i > line + own) other = std::max(other, std::norm(spectrum[i]));
  }
  return std::norm(spectrum[line]) > lone_power * other;
}

}  // namespace

double strongest_frequency_hz(const std::vector<double>& values, double period_s) {
  const auto spectrum = windowed_spectrum(values);
  const auto top = std::max_element(
      spectrum.begin(), spectrum.end(),
      [](const Complex& a, const Complex& b) { return std::norm(a) < std::norm(b); });
  if (!(std::norm(*top) > 0.0)) return 0.0;
  return 0.5 * static_cast<double>(top - spectrum.begin()) /
         (period_s * static_cast<double>(spectrum.size()));
}

double apparent_hz(double frequency_hz, double period_s) {
  return std::abs(frequency_hz - std::round(frequency_hz * period_s) / period_s);
}

std::optional<physics::Line> mains_of(const std::vector<double>& values, double period_s,
                                      bool lone) {
  const auto spectrum = windowed_spectrum(values);
  const double step_hz = 0.5 / (period_s * static_cast<double>(spectrum.size()));
  // Resolution of the unpadded values.
  const double resolution_hz = 1.0 / (period_s * static_cast<double>(values.size()));
  const double motion_hz = lone ? strongest_frequency_hz(values, period_s) : 0.0;
  std::optional<physics::Line> strongest;
  for (const double hz : mains_hz) {
    const double seen_hz = apparent_hz(hz, period_s);
    const bool alias = seen_hz != hz;
    if (alias && (!lone || seen_hz < above_motion * motion_hz)) continue;
    const auto bin = significant_bin(spectrum, step_hz, resolution_hz, seen_hz, hz);
    if (!bin || (lone && !is_lone(spectrum, step_hz, resolution_hz, *bin))) continue;
    const physics::Line line =
        refined_line(values, period_s, static_cast<double>(*bin) * step_hz, step_hz);
    if (!strongest || line.amplitude > strongest->amplitude) strongest = line;
  }
  return strongest;
}

double mains_behind(double frequency_hz, double period_s) {
  return *std::min_element(mains_hz.begin(), mains_hz.end(), [&](double a, double b) {
    return std::abs(apparent_hz(a, period_s) - frequency_hz) <
           std::abs(apparent_hz(b, period_s) - frequency_hz);
  });
}

std::vector<double> without_mains(std::vector<double> values, double period_s) {
  const std::optional<physics::Line> line = mains_of(values, period_s);
  if (!line) return values;
  for (std::size_t k = 0; k < values.size(); ++k) {
    const double t = period_s * static_cast<double>(k);
    values[k] -= line->amplitude * std::sin(2.0 * pi * line->frequency_hz * t + line->phase_rad);
  }
  return values;
}

}  // namespace stickslip::diagnosis
