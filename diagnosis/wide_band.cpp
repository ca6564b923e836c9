// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/wide_band.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

#include "diagnosis/fourier.h"
#include "diagnosis/median.h"
#include "diagnosis/noise_floor.h"

namespace stickslip::diagnosis {

namespace {

using Complex = std::complex<double>;

// Lengths with small prime factors are fast to transform.
bool has_small_factors(std::size_t n) {
  for (const std::size_t prime : {2U, 3U, 5U, 7U}) {
    while (n % prime == 0) n /= prime;
  }
  return n == 1;
}

// Fourth-degree polynomial through the `count` samples at one end, over the time from that end.
struct EndPolynomial {
  double curvature = 0.0;
  double curvature_std = 0.0;
  double residual_std = 0.0;
};

EndPolynomial polynomial_at_end(std::span<const double> samples, std::size_t count, double period_s,
                                double noise_std, bool at_the_end) {
  constexpr Eigen::Index degree = 4;
  const auto rows = static_cast<Eigen::Index>(count);
  const double span = static_cast<double>(count - 1);
  Eigen::MatrixXd powers(rows, degree + 1);
  Eigen::VectorXd values(rows);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const auto k = static_cast<std::size_t>(i);
    values[i] = samples[at_the_end ? samples.size() - 1 - k : k];
    double power = 1.0;
    for (Eigen::Index j = 0; j <= degree; ++j, power *= static_cast<double>(i) / span) {
      powers(i, j) = power;
    }
  }
  const Eigen::LDLT<Eigen::MatrixXd> normal(powers.transpose() * powers);
  const Eigen::VectorXd found = normal.solve(powers.transpose() * values);
  const Eigen::VectorXd unit = Eigen::VectorXd::Unit(degree + 1, 2);
  const double scale = 2.0 / std::pow(span * period_s, 2);
  const double freedom = static_cast<double>(rows - degree - 1);
  return {scale * found[2], scale * noise_std * std::sqrt(normal.solve(unit)[2]),
          std::sqrt((powers * found - values).squaredNorm() / freedom)};
}

// Second derivative at one end of the samples, from as many of them as a polynomial fits; 0 where
// it is not significant.
double curvature_at_end(std::span<const double> samples, double period_s, double noise_std,
                        bool at_the_end) {
  constexpr double max_span_s = 0.2;
  constexpr std::size_t min_count = 16;
  if (samples.size() < 4 * min_count) return 0.0;
  auto count = std::clamp<std::size_t>(static_cast<std::size_t>(std::lround(max_span_s / period_s)),
                                       min_count, samples.size() / 4);
  EndPolynomial end = polynomial_at_end(samples, count, period_s, noise_std, at_the_end);
  while (end.residual_std > 1.5 * noise_std && count > min_count) {
    count = std::max(min_count, count * 3 / 4);
    end = polynomial_at_end(samples, count, period_s, noise_std, at_the_end);
  }
  return std::abs(end.curvature) > 3.0 * end.curvature_std ? end.curvature : 0.0;
}

// Exponential that decays from one end of a recording. exp(s t) is an eigenfunction of a chain of
// filters: the signal before them is known exactly.
struct Exponential {
  double s_per_s = 0.0;   // rate
  double origin_s = 0.0;  // where it is `amplitude`
  double amplitude = 0.0;

  double at(double time_s) const { return amplitude * std::exp(s_per_s * (time_s - origin_s)); }
};

// For each end two exponentials whose sum is 0 there and has the curvature of the samples.
std::vector<Exponential> end_curvatures(std::span<const double> samples, double period_s,
                                        double noise_std) {
  std::vector<Exponential> out;
  const double duration_s = period_s * static_cast<double>(samples.size() - 1);
  const double fade_s = std::min(0.25, duration_s / 16.0);
  for (const bool at_the_end : {false, true}) {
    const double curvature = curvature_at_end(samples, period_s, noise_std, at_the_end);
    if (curvature == 0.0) continue;
    const double amplitude = -curvature * fade_s * fade_s / 3.0;
    const double rate = (at_the_end ? 1.0 : -1.0) / fade_s;
    const double origin = at_the_end ? duration_s : 0.0;
    out.push_back({rate, origin, amplitude});
    out.push_back({2.0 * rate, origin, -amplitude});
  }
  return out;
}

// Bins on each side over which the power is averaged.
constexpr std::ptrdiff_t averaged_bins = 16;
// Spectral subtraction: bins whose averaged power is below this multiple of the noise power are
// removed. The average of 33 bins exceeds it by chance less than once in 1e9; one bin of noise
// passed on would be amplified by the inverse filter.
constexpr double pass_ratio = 4.0;
// Regularisation of the inverse filter.
constexpr double inverse_floor = 1.0e-6;
// Power of the signal that may be hidden below the noise in removed bins, over the noise power, ...
constexpr double hidden_ratio = 1.0;
// ... up to this frequency at least: a slowly driven base has little above it.
constexpr double hidden_up_to_hz = 10.0;

// The line between the first and the last sample.
struct Line {
  double first = 0.0;
  double slope = 0.0;  // per sample
};

// Odd periodic extension of the samples less their line: continuous with its slope.
std::vector<double> odd_extension(const std::vector<double>& samples, const Line& line) {
  const std::size_t half = samples.size() - 1;
  const std::size_t length = 2 * half;
  std::vector<double> odd(length, 0.0);
  for (std::size_t i = 1; i < half; ++i) {
    odd[i] = samples[i] - line.first - line.slope * static_cast<double>(i);
    odd[length - i] = -odd[i];
  }
  return odd;
}

// Power of bins 0 to half of a spectrum, averaged over neighbours.
class AveragedPower {
 public:
  AveragedPower(const std::vector<Complex>& spectrum, std::size_t half)
      : bins_(static_cast<std::ptrdiff_t>(half)), sum_(half + 2, 0.0) {
    for (std::size_t k = 0; k <= half; ++k) sum_[k + 1] = sum_[k] + std::norm(spectrum[k]);
  }
  double at(std::ptrdiff_t k) const {
    const auto low = static_cast<std::size_t>(std::max<std::ptrdiff_t>(0, k - averaged_bins));
    const auto high = static_cast<std::size_t>(std::min(bins_, k + averaged_bins));
    return (sum_[high + 1] - sum_[low]) / static_cast<double>(high + 1 - low);
  }

 private:
  std::ptrdiff_t bins_;
  std::vector<double> sum_;
};

struct WideBandSpectra {
  std::vector<Complex> value, rate, acceleration;
  std::vector<double> rate_error, acceleration_error;  // power, by bin
  double highest_hz = 0.0;                             // of the bins that passed
};

WideBandSpectra inverse_filtered(const std::vector<Complex>& spectrum, double period_s,
                                 const physics::FilterChain& chain, const NoiseFloor& noise,
                                 double lead_s) {
  const std::size_t length = spectrum.size();
  const std::size_t half = length / 2;
  const AveragedPower power(spectrum, half);
  WideBandSpectra out;
  for (auto* each : {&out.value, &out.rate, &out.acceleration}) each->resize(length);
  out.rate_error.assign(half + 1, 0.0);
  out.acceleration_error.assign(half + 1, 0.0);
  for (std::size_t i = 0; i <= half; ++i) {
    const double frequency = static_cast<double>(i) / (static_cast<double>(length) * period_s);
    const double mean = power.at(static_cast<std::ptrdiff_t>(i));
    const double noise_power = noise.at(frequency) * static_cast<double>(length);
    const double gain = mean > pass_ratio * noise_power ? 1.0 - noise_power / mean : 0.0;
    const Complex response = chain.response(frequency);
    const Complex s(0.0, 2.0 * std::numbers::pi * frequency);
    const Complex inverse =
        std::conj(response) / (std::norm(response) + inverse_floor) * std::exp(s * lead_s);
    const Complex y = spectrum[i] * gain * inverse;
    out.value[i] = y;
    out.rate[i] = y * s;
    out.acceleration[i] = y * s * s;
    if (gain > 0.0) out.highest_hz = frequency;
    const double error = (gain > 0.0 ? gain * gain : hidden_ratio) * noise_power;
    out.rate_error[i] = error * std::norm(inverse * s);
    out.acceleration_error[i] = error * std::norm(inverse * s * s);
    if (i > 0 && i < half) {
      for (auto* each : {&out.value, &out.rate, &out.acceleration}) {
        (*each)[length - i] = std::conj((*each)[i]);
      }
    }
  }
  out.rate[half] = 0.0;
  return out;
}

// `error`: power by bin, of `spectra`.
double error_std(const std::vector<double>& error, const WideBandSpectra& spectra,
                 double period_s) {
  const auto length = static_cast<double>(spectra.value.size());
  double power = 0.0;
  for (std::size_t i = 0; i < error.size(); ++i) {
    const double frequency = static_cast<double>(i) / (length * period_s);
    if (frequency > std::max(1.3 * spectra.highest_hz, hidden_up_to_hz)) break;
    power += error[i];
  }
  // Two bins per frequency; the inverse transform divides by the length.
  return std::sqrt(2.0 * power) / length;
}

// The line passes through the chain as a line; removing the chain's lag moves it by slope * lag.
void add_line(WideBand& out, const Line& line, double period_s, const physics::FilterChain& chain,
              double lead_s) {
  const double small = 1.0e-3;
  const double lag = lead_s - std::arg(chain.response(small)) / (2.0 * std::numbers::pi * small);
  for (std::size_t i = 0; i < out.value.size(); ++i) {
    out.value[i] += line.first + line.slope * (static_cast<double>(i) + lag / period_s);
    out.rate[i] += line.slope / period_s;
  }
}

void add_inverse_filtered(WideBand& out, const Exponential& each, double period_s,
                          const physics::FilterChain& chain, double lead_s) {
  const double inverse =
      std::exp(each.s_per_s * lead_s) * (1.0 / chain.transfer({each.s_per_s, 0.0})).real();
  for (std::size_t i = 0; i < out.value.size(); ++i) {
    const double value = inverse * each.at(period_s * static_cast<double>(i));
    out.value[i] += value;
    out.rate[i] += each.s_per_s * value;
    out.acceleration[i] += each.s_per_s * each.s_per_s * value;
  }
}

// For lengths that are fast to transform. Zero padding to such a length would give the odd
// extension a kink.
WideBand wide_band_of_fast_length(std::span<const double> samples, double period_s,
                                  const physics::FilterChain& chain, const NoiseFloor& noise,
                                  double lead_s) {
  const std::size_t n = samples.size();
  const std::size_t half = n - 1;  // half a period of the odd extension

  // The odd extension would have a kink in its second derivative at both ends, which rings far into
  // the acceleration. Exponentials with that curvature are subtracted here and added,
  // inverse-filtered exactly, at the end.
  const std::vector<Exponential> curvatures = end_curvatures(samples, period_s, noise.white_std());
  std::vector<double> rest(samples.begin(), samples.end());
  for (std::size_t i = 0; i < n; ++i) {
    for (const Exponential& each : curvatures)
      rest[i] -= each.at(period_s * static_cast<double>(i));
  }
  const Line line{rest.front(), (rest.back() - rest.front()) / static_cast<double>(half)};
  const std::vector<double> odd = odd_extension(rest, line);

  const std::vector<std::complex<double>> spectrum = fourier(odd);
  const WideBandSpectra spectra = inverse_filtered(spectrum, period_s, chain, noise, lead_s);

  WideBand out;
  out.rate_noise_std = error_std(spectra.rate_error, spectra, period_s);
  out.acceleration_noise_std = error_std(spectra.acceleration_error, spectra, period_s);
  out.highest_hz = spectra.highest_hz;
  const auto back = [&](const std::vector<Complex>& from) {
    const std::vector<Complex> time = inverse_fourier(from);
    std::vector<double> real(n);
    for (std::size_t i = 0; i < n; ++i) real[i] = time[i].real();
    return real;
  };
  out.value = back(spectra.value);
  out.rate = back(spectra.rate);
  out.acceleration = back(spectra.acceleration);
  add_line(out, line, period_s, chain, lead_s);
  for (const Exponential& each : curvatures) {
    add_inverse_filtered(out, each, period_s, chain, lead_s);
  }
  return out;
}

}  // namespace

WideBand wide_band(std::span<const double> samples, double period_s,
                   const physics::FilterChain& chain, double noise_std) {
  return wide_band(samples, period_s, chain, NoiseFloor(noise_std));
}

WideBand wide_band(std::span<const double> samples, double period_s,
                   const physics::FilterChain& chain, const NoiseFloor& noise, double lead_s) {
  const std::size_t n = samples.size();
  std::size_t fast = n;
  while (!has_small_factors(fast - 1)) --fast;
  WideBand out = wide_band_of_fast_length(samples.first(fast), period_s, chain, noise, lead_s);
  if (fast == n) return out;
  // Once from each end: the first half from the leading samples, the second from the trailing ones.
  const WideBand later =
      wide_band_of_fast_length(samples.last(fast), period_s, chain, noise, lead_s);
  const auto half = static_cast<std::ptrdiff_t>(fast / 2);
  const auto missing = static_cast<std::ptrdiff_t>(n - fast);
  for (auto member : {&WideBand::value, &WideBand::rate, &WideBand::acceleration}) {
    std::vector<double>& values = out.*member;
    values.resize(static_cast<std::size_t>(half));
    values.insert(values.end(), (later.*member).begin() + (half - missing), (later.*member).end());
  }
  return out;
}

double noise_of(std::span<const double> samples) {
  if (samples.size() < 16) return 0.0;
  constexpr std::array<double, 7> weight = {1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0};
  constexpr double weight_norm = 924.0;  // sum of the squares
  std::vector<double> differences;
  differences.reserve(samples.size());
  double smallest_step = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i + weight.size() <= samples.size(); ++i) {
    double sum = 0.0;
    for (std::size_t k = 0; k < weight.size(); ++k) sum += weight[k] * samples[i + k];
    differences.push_back(std::abs(sum));
    const double step = std::abs(samples[i + 1] - samples[i]);
    if (step > 0.0) smallest_step = std::min(smallest_step, step);
  }
  const double from_differences = median(differences) / 0.6745 / std::sqrt(weight_norm);
  const double range = std::abs(*std::max_element(samples.begin(), samples.end()) -
                                *std::min_element(samples.begin(), samples.end()));
  // A step near the resolution of doubles at this range is rounding, not quantisation.
  const double quantisation = std::isfinite(smallest_step) && smallest_step > 1.0e-12 * range
                                  ? smallest_step / std::sqrt(12.0)
                                  : 0.0;
  return std::max(from_differences, quantisation);
}

}  // namespace stickslip::diagnosis
