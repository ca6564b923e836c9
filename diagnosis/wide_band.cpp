#include "diagnosis/wide_band.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <unsupported/Eigen/FFT>

#include "diagnosis/median.h"

namespace stickslip::diagnosis {

namespace {

using Complex = std::complex<double>;

// The transform is fast for lengths with small prime factors only.
bool has_small_factors(std::size_t n) {
  for (const std::size_t prime : {2U, 3U, 5U, 7U}) {
    while (n % prime == 0) n /= prime;
  }
  return n == 1;
}

// A polynomial of fourth degree through `count` samples at one end, as time goes away from it.
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

// The second derivative at one end of the samples; 0 where noise alone would give as much. Looks as
// far as the polynomial still fits.
double curvature_at_end(std::span<const double> samples, double period_s, double noise_std,
                        bool at_the_end) {
  constexpr double longest_s = 0.2;
  constexpr std::size_t fewest = 16;
  if (samples.size() < 4 * fewest) return 0.0;
  auto count = std::clamp<std::size_t>(static_cast<std::size_t>(std::lround(longest_s / period_s)),
                                       fewest, samples.size() / 4);
  EndPolynomial end = polynomial_at_end(samples, count, period_s, noise_std, at_the_end);
  while (end.residual_std > 1.5 * noise_std && count > fewest) {
    count = std::max(fewest, count * 3 / 4);
    end = polynomial_at_end(samples, count, period_s, noise_std, at_the_end);
  }
  return std::abs(end.curvature) > 3.0 * end.curvature_std ? end.curvature : 0.0;
}

// A fading exponential at one end of a recording. exp(s t) passes through a chain of filters as
// itself, multiplied by a number: what it was before them is known exactly.
struct Fading {
  double s_per_s = 0.0;   // rate
  double origin_s = 0.0;  // where it is `amplitude`
  double amplitude = 0.0;

  double at(double time_s) const { return amplitude * std::exp(s_per_s * (time_s - origin_s)); }
};

// Two that together are 0 at each end and curve there as the samples do.
std::vector<Fading> end_curvatures(std::span<const double> samples, double period_s,
                                   double noise_std) {
  std::vector<Fading> out;
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

// For a number of samples that the transform is fast for. Its odd extension ends where the samples
// do: were it drawn out to a longer one, it would have a kink where it ends.
WideBand wide_band_of_fast_length(std::span<const double> samples, double period_s,
                                  const physics::FilterChain& chain, double noise_std) {
  const std::size_t n = samples.size();
  const std::size_t half = n - 1;  // half a period of the odd extension

  // The odd extension below would have a kink in its second derivative at both ends, which rings
  // far into the acceleration. What makes the kink is taken out here and put back, undone exactly,
  // at the end.
  const std::vector<Fading> fading = end_curvatures(samples, period_s, noise_std);
  std::vector<double> rest(samples.begin(), samples.end());
  for (std::size_t i = 0; i < n; ++i) {
    for (const Fading& each : fading) rest[i] -= each.at(period_s * static_cast<double>(i));
  }

  // Take out the line between the ends, so that the odd extension is continuous with its slope.
  const double first = rest.front();
  const double slope = (rest.back() - first) / static_cast<double>(half);
  const std::size_t length = 2 * half;
  std::vector<double> odd(length, 0.0);
  for (std::size_t i = 1; i < half; ++i) {
    odd[i] = rest[i] - first - slope * static_cast<double>(i);
    odd[length - i] = -odd[i];
  }

  Eigen::FFT<double> fft;
  std::vector<Complex> spectrum;
  fft.fwd(spectrum, odd);

  const double noise_power = noise_std * noise_std * static_cast<double>(length);
  constexpr std::ptrdiff_t reach = 16;  // bins on each side over which the power is averaged
  const auto bins = static_cast<std::ptrdiff_t>(half);
  std::vector<double> sum(static_cast<std::size_t>(bins) + 2, 0.0);
  for (std::ptrdiff_t k = 0; k <= bins; ++k) {
    sum[static_cast<std::size_t>(k) + 1] =
        sum[static_cast<std::size_t>(k)] + std::norm(spectrum[static_cast<std::size_t>(k)]);
  }
  std::vector<Complex> value(length);
  std::vector<Complex> rate(length);
  std::vector<Complex> acceleration(length);
  // By bin, what the acceleration is wrong by: the noise that was let through, and what may hide
  // under the noise where nothing was.
  // As much as the noise itself: more than three times that would have been let through. A base
  // that is driven slowly has little to hide at high frequencies.
  constexpr double hidden = 1.0;
  constexpr double may_hide_hz = 10.0;
  std::vector<double> doubt(half + 1, 0.0);
  double highest_hz = 0.0;  // of what was let through
  for (std::ptrdiff_t k = 0; k <= bins; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const auto low = static_cast<std::size_t>(std::max<std::ptrdiff_t>(0, k - reach));
    const auto high = static_cast<std::size_t>(std::min(bins, k + reach));
    const double power = (sum[high + 1] - sum[low]) / static_cast<double>(high + 1 - low);
    // Spectral subtraction. The average of 33 bins exceeds four times its mean by chance less than
    // once in a billion: one bin of noise let through would be blown up by the undone filter.
    const double gain = power > 4.0 * noise_power ? 1.0 - noise_power / power : 0.0;
    const double frequency = static_cast<double>(k) / (static_cast<double>(length) * period_s);
    const Complex response = chain.response(frequency);
    const double floor = 1.0e-6;
    const Complex inverse = std::conj(response) / (std::norm(response) + floor);
    const Complex y = spectrum[i] * gain * inverse;
    const Complex s(0.0, 2.0 * std::numbers::pi * frequency);
    value[i] = y;
    rate[i] = y * s;
    acceleration[i] = y * s * s;
    if (gain > 0.0) highest_hz = frequency;
    const double noise = noise_power * std::norm(inverse * s * s);
    doubt[i] = gain > 0.0 ? gain * gain * noise : hidden * noise;
    if (k > 0 && k < bins) {
      value[length - i] = std::conj(value[i]);
      rate[length - i] = std::conj(rate[i]);
      acceleration[length - i] = std::conj(acceleration[i]);
    }
  }
  rate[half] = 0.0;

  WideBand out;
  double power = 0.0;
  for (std::size_t i = 0; i <= half; ++i) {
    const double frequency = static_cast<double>(i) / (static_cast<double>(length) * period_s);
    if (frequency > std::max(1.3 * highest_hz, may_hide_hz)) break;
    power += doubt[i];
  }
  // Two bins to a frequency; the inverse transform divides by the length.
  out.acceleration_noise_std = std::sqrt(2.0 * power) / static_cast<double>(length);
  const auto back = [&](const std::vector<Complex>& from) {
    std::vector<Complex> time;
    fft.inv(time, from);
    std::vector<double> real(n);
    for (std::size_t i = 0; i < n; ++i) real[i] = time[i].real();
    return real;
  };
  out.value = back(value);
  out.rate = back(rate);
  out.acceleration = back(acceleration);
  // The line passes through the chain as a line; undoing the chain's lag moves it by slope * lag.
  const double small = 1.0e-3;
  const double lag = -std::arg(chain.response(small)) / (2.0 * std::numbers::pi * small);
  for (std::size_t i = 0; i < n; ++i) {
    out.value[i] += first + slope * (static_cast<double>(i) + lag / period_s);
    out.rate[i] += slope / period_s;
  }
  for (const Fading& each : fading) {
    const double undone = (1.0 / chain.transfer({each.s_per_s, 0.0})).real();
    for (std::size_t i = 0; i < n; ++i) {
      const double value = undone * each.at(period_s * static_cast<double>(i));
      out.value[i] += value;
      out.rate[i] += each.s_per_s * value;
      out.acceleration[i] += each.s_per_s * each.s_per_s * value;
    }
  }
  return out;
}

}  // namespace

WideBand wide_band(std::span<const double> samples, double period_s,
                   const physics::FilterChain& chain, double noise_std) {
  const std::size_t n = samples.size();
  std::size_t fast = n;
  while (!has_small_factors(fast - 1)) --fast;
  WideBand out = wide_band_of_fast_length(samples.first(fast), period_s, chain, noise_std);
  if (fast == n) return out;
  // Once from each end: the first half of what begins at the beginning, the rest of what ends at
  // the end.
  const WideBand later = wide_band_of_fast_length(samples.last(fast), period_s, chain, noise_std);
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
  // A step far below the resolution of doubles at this range is rounding, not quantisation.
  const double quantisation = std::isfinite(smallest_step) && smallest_step > 1.0e-12 * range
                                  ? smallest_step / std::sqrt(12.0)
                                  : 0.0;
  return std::max(from_differences, quantisation);
}

}  // namespace stickslip::diagnosis
