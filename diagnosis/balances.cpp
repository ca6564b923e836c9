// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/balances.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include "diagnosis/channel_readings.h"
#include "diagnosis/fourier.h"
#include "diagnosis/parallel/for_each.h"
#include "diagnosis/rerun.h"
#include "diagnosis/significance.h"
#include "diagnosis/time_grid.h"
#include "physics/model_consistency.h"

namespace stickslip::diagnosis {

namespace {

using physics::Model;
using Complex = std::complex<double>;

constexpr std::size_t most_instants = 1U << 17U;
constexpr std::size_t fewest_blocks = 8;
constexpr double periods_per_block = 3.0;
constexpr std::size_t speed_classes = 8;
constexpr double step_sigmas = 0.3;  // of the difference that makes a column
constexpr double smoothed_hz = 0.5;  // of the spectrum that whitens, at least
constexpr double smoothed_share = 0.125;
// Time around a sample within which a slow motion disturbs it: settling of usual filters.
constexpr double slow_reach_s = 0.02;

// Values at equal distances over a stretch and its padding.
using Values = std::vector<double>;

// One balance of one stretch: residual, and its change by one standard deviation of each number.
struct BalanceSeries {
  Values residual;
  std::vector<Values> column;  // empty: no change
};

// A stretch with its balances; the simulated one has the same instants and bands.
struct Observed {
  ReadingSpectra stretch;
  Values speed;  // magnitude at the instants of the stretch [m/s]
  std::array<BalanceSeries, balance_count> balance;
};

struct Pair {
  Observed recorded;
  Observed simulated;
  BalanceBands bands;
  double period_of_motion_s = 1.0;
};

// BalanceResiduals of one balance as numbers of equal weight, with the block of each.
struct Rows {
  Eigen::MatrixXd column;
  Eigen::VectorXd residual;
  std::vector<std::size_t> block;
  double independent = 1.0;  // share of the rows that are
};

// The calibrated numbers, none farther from what is declared than an instrument may be.
Model within_priors(const BalanceCase& measured, double most_sigmas) {
  Model out = measured.calibrated;
  Model declared = measured.declared;
  const auto limits = physics::parameters_of(declared);
  const auto values = physics::parameters_of(out);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double centre = limits[i].parameter->value;
    const double reach = most_sigmas * limits[i].parameter->sigma;
    values[i].parameter->value =
        std::clamp(values[i].parameter->value, centre - reach, centre + reach);
    values[i].parameter->sigma = limits[i].parameter->sigma;
  }
  return physics::inconsistencies_of(out).empty() ? out : measured.declared;
}

// Distance of each uncertain number from its declared value, in standard deviations.
std::vector<std::pair<std::size_t, double>> uncertain_numbers(const Model& model,
                                                              const Model& declared) {
  Model here = model;
  Model there = declared;
  const auto values = physics::parameters_of(here);
  const auto centres = physics::parameters_of(there);
  std::vector<std::pair<std::size_t, double>> out;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double sigma = centres[i].parameter->sigma;
    if (!(sigma > 0.0)) continue;
    out.emplace_back(i, (values[i].parameter->value - centres[i].parameter->value) / sigma);
  }
  return out;
}

// By instant: true where the channel was read.
std::vector<bool> instants_read(const ChannelReadings& readings, std::size_t samples) {
  std::vector<bool> out(samples, false);
  for (const Reading& reading : readings.list) {
    const double nearest = std::round(reading.at);
    if (nearest >= 0.0 && nearest < static_cast<double>(samples)) {
      out[static_cast<std::size_t>(nearest)] = true;
    }
  }
  return out;
}

// A recording of `model` with what was not measured in `recorded` left out, and with noise alone in
// channels that the model does not have.
protocol::Recording simulated_like(const Experiment& e, const protocol::Recording& recorded,
                                   const Model& model, std::uint64_t seed) {
  Rerun run;
  run.from_recorded_state = true;
  protocol::Recording out = rerun(e, model, run, seed);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const std::size_t begin = e.longest_segment().begin;
  const TimeGrid grid = time_grid_of(recorded.frames);
  for (const Channel channel : all_channels) {
    const std::size_t c = index_of(channel);
    if (!(e.noise_std[c] > 0.0)) continue;
    const auto read = instants_read(readings_of(recorded.frames, grid, channel), e.samples);
    for (std::size_t k = 0; k < out.frames.size(); ++k) {
      Frame& frame = out.frames[k];
      if (!frame.has(channel)) frame.set(channel, e.noise_std[c] * normal(random));
      if (!read[begin + k]) frame.invalidate(channel);
    }
    out.channels = static_cast<std::uint8_t>(out.channels | (1U << c));
  }
  return out;
}

// Weight that leaves only what no taper touches.
double interior_at(const ReadingSpectra& stretch, double instant) {
  const auto ramp = static_cast<double>(stretch.ramp);
  const double from_end = std::min(instant, static_cast<double>(stretch.count - 1) - instant);
  const double share = std::clamp(from_end / ramp - 2.0, 0.0, 1.0);
  return 0.5 - 0.5 * std::cos(std::numbers::pi * share);
}

std::size_t points_for(const BalanceBand& band) { return fast_length(2 * band.last + 2); }

Values in_time(const ReadingSpectra& stretch, const HalfSpectrum& spectrum,
               const BalanceBand& band) {
  Values out = samples_of(spectrum, stretch.padded, points_for(band));
  const double spacing = static_cast<double>(stretch.padded) / static_cast<double>(out.size());
  for (std::size_t j = 0; j < out.size(); ++j) {
    const double instant = spacing * static_cast<double>(j);
    out[j] *= instant < static_cast<double>(stretch.count) ? interior_at(stretch, instant) : 0.0;
  }
  return out;
}

void set_speed(Observed& observed, const Model& model) {
  observed.speed = measured_velocity(observed.stretch, model);
  for (double& v : observed.speed) v = std::abs(v);
}

// The change of all residuals by one standard deviation of the number; no element for none.
BalanceResiduals change_by(const Observed& observed, const BalanceBands& bands, const Model& model,
                           std::size_t number, const BalanceResiduals& base,
                           const ContactForce& contact) {
  BalanceResiduals out;
  Model varied = model;
  physics::Parameter& parameter = *physics::parameters_of(varied)[number].parameter;
  parameter.value += step_sigmas * parameter.sigma;
  if (!physics::inconsistencies_of(varied).empty()) return out;
  const BalanceResiduals after = residuals_of(observed.stretch, bands, varied, contact);
  for (std::size_t b = 0; b < balance_count; ++b) {
    double largest = 0.0;
    HalfSpectrum change(base[b].size());
    for (std::size_t i = 0; i < change.size(); ++i) {
      change[i] = (after[b][i] - base[b][i]) / step_sigmas;
      largest = std::max(largest, std::norm(change[i]));
    }
    if (largest > 0.0) out[b] = std::move(change);
  }
  return out;
}

void set_balances(std::span<Observed* const> all, const BalanceBands& bands, const Model& model,
                  const std::vector<std::pair<std::size_t, double>>& numbers, int threads) {
  std::vector<BalanceResiduals> base(all.size());
  std::vector<ContactForce> contact(all.size());
  parallel::for_each(all.size(), threads, [&](std::size_t i) {
    contact[i].of(all[i]->stretch, model,
                  std::max(bands[index_of(Balance::force_balance)].last,
                           bands[index_of(Balance::friction_law)].last));
    base[i] = residuals_of(all[i]->stretch, bands, model, contact[i]);
    for (std::size_t b = 0; b < balance_count; ++b) {
      all[i]->balance[b].column.resize(numbers.size());
      if (base[b].empty() || bands[b].empty()) continue;
      all[i]->balance[b].residual = in_time(all[i]->stretch, base[i][b], bands[b]);
    }
  });
  parallel::for_each(all.size() * numbers.size(), threads, [&](std::size_t task) {
    const std::size_t i = task / numbers.size();
    const std::size_t k = task % numbers.size();
    const BalanceResiduals change =
        change_by(*all[i], bands, model, numbers[k].first, base[i], contact[i]);
    for (std::size_t b = 0; b < balance_count; ++b) {
      if (change[b].empty() || bands[b].empty()) continue;
      all[i]->balance[b].column[k] = in_time(all[i]->stretch, change[b], bands[b]);
    }
  });
}

double strongest_period_s(const ReadingSpectra& stretch) {
  const HalfSpectrum& x = stretch.spectrum[index_of(Channel::displacement)];
  constexpr std::size_t lowest = 4;  // of a motion and no trend
  std::size_t strongest = lowest;
  for (std::size_t i = lowest; i < x.size(); ++i) {
    if (std::norm(x[i]) > std::norm(x[strongest])) strongest = i;
  }
  return 1.0 / (stretch.bin_hz() * static_cast<double>(strongest));
}

Pair pair_of(const protocol::Recording& recording, const Experiment& e, const Model& model,
             std::uint64_t seed) {
  Pair out;
  const protocol::Recording simulated = simulated_like(e, recording, model, seed);
  Experiment of_simulated;
  of_simulated.period_s = e.period_s;
  of_simulated.samples = simulated.frames.size();
  of_simulated.noise_std = e.noise_std;
  const std::size_t most = std::min(most_instants, simulated.frames.size());
  out.recorded.stretch = stretch_of(recording, e, model, most);
  out.simulated.stretch = stretch_of(simulated, of_simulated, model, most);
  out.bands = bands_of(out.recorded.stretch, model);
  for (const Channel channel : all_channels) {
    if (out.recorded.stretch.has(channel) && !out.simulated.stretch.has(channel)) out.bands = {};
  }
  set_speed(out.recorded, model);
  set_speed(out.simulated, model);
  out.period_of_motion_s = strongest_period_s(out.recorded.stretch);
  return out;
}

HalfSpectrum spectrum_of_values(const Values& values) {
  HalfSpectrum out = fourier(values);
  out.resize(values.size() / 2 + 1);
  return out;
}

// Power of simulated residuals, smoothed, by bin.
Values smooth_power(const HalfSpectrum& spectrum, const BalanceBand& band, double bin_hz) {
  Values sum(band.last + 1, 0.0);
  for (std::size_t i = 0; i < band.last; ++i) sum[i + 1] = sum[i] + std::norm(spectrum[i]);
  Values out(band.last, 0.0);
  for (std::size_t i = band.first; i < band.last; ++i) {
    const double reach_hz = std::max(smoothed_hz, smoothed_share * bin_hz * static_cast<double>(i));
    const auto reach = static_cast<std::size_t>(reach_hz / bin_hz);
    const std::size_t low = i > band.first + reach ? i - reach : band.first;
    const std::size_t high = std::min(band.last, i + reach + 1);
    out[i] = (sum[high] - sum[low]) / static_cast<double>(high - low);
  }
  return out;
}

Values whitened(const Values& values, const BalanceBand& band, const Values& power) {
  HalfSpectrum spectrum = spectrum_of_values(values);
  for (std::size_t i = 0; i < spectrum.size(); ++i) {
    const bool inside = i >= band.first && i < band.last && power[i] > 0.0;
    spectrum[i] *= inside ? 1.0 / std::sqrt(power[i]) : 0.0;
  }
  return samples_of(spectrum, values.size(), values.size());
}

// The rows that no taper touches, as indices into the values of a balance.
std::vector<std::size_t> interior(const ReadingSpectra& stretch, std::size_t points) {
  const double spacing = static_cast<double>(stretch.padded) / static_cast<double>(points);
  std::vector<std::size_t> out;
  for (std::size_t j = 0; j < points; ++j) {
    const double instant = spacing * static_cast<double>(j);
    if (instant < static_cast<double>(stretch.count) && interior_at(stretch, instant) >= 1.0) {
      out.push_back(j);
    }
  }
  return out;
}

// Lowest speed around each of these rows.
Values lowest_speed(const Observed& observed, const std::vector<std::size_t>& rows,
                    std::size_t points) {
  const ReadingSpectra& stretch = observed.stretch;
  const double spacing = static_cast<double>(stretch.padded) / static_cast<double>(points);
  const auto reach = static_cast<std::size_t>(std::max(spacing, slow_reach_s / stretch.period_s));
  Values out;
  for (const std::size_t row : rows) {
    const auto at = static_cast<std::size_t>(spacing * static_cast<double>(row));
    const auto first =
        observed.speed.begin() + static_cast<std::ptrdiff_t>(at - std::min(at, reach));
    const auto last = observed.speed.begin() +
                      static_cast<std::ptrdiff_t>(std::min(observed.speed.size(), at + reach + 1));
    out.push_back(*std::min_element(first, last));
  }
  return out;
}

// Weights by lowest speed, of equal energy in the simulated recording.
class SpeedWeights {
 public:
  SpeedWeights(const Values& speed, const Eigen::VectorXd& residual) {
    Values sorted = speed;
    std::sort(sorted.begin(), sorted.end());
    for (std::size_t i = 1; i < speed_classes; ++i) {
      edges_.push_back(sorted[i * sorted.size() / speed_classes]);
    }
    Values energy(speed_classes, 0.0);
    Values count(speed_classes, 0.0);
    for (std::size_t i = 0; i < speed.size(); ++i) {
      energy[class_of(speed[i])] += std::pow(residual[static_cast<Eigen::Index>(i)], 2);
      count[class_of(speed[i])] += 1.0;
    }
    for (std::size_t i = 0; i < speed_classes; ++i) {
      weight_.push_back(energy[i] > 0.0 ? std::sqrt(count[i] / energy[i]) : 0.0);
    }
  }
  double of(double speed) const { return weight_[class_of(speed)]; }

 private:
  std::size_t class_of(double speed) const {
    return static_cast<std::size_t>(
        std::distance(edges_.begin(), std::upper_bound(edges_.begin(), edges_.end(), speed)));
  }
  Values edges_;
  Values weight_;
};

// Without weights yet.
Rows rows_of(const Observed& observed, std::size_t b, const BalanceBand& band, const Values& power,
             const std::vector<std::size_t>& rows) {
  const BalanceSeries& series = observed.balance[b];
  Rows out;
  const auto count = static_cast<Eigen::Index>(rows.size());
  const auto pick = [&](const Values& values, auto&& column) {
    const Values white = whitened(values, band, power);
    for (Eigen::Index i = 0; i < count; ++i) column[i] = white[rows[static_cast<std::size_t>(i)]];
  };
  out.residual.resize(count);
  pick(series.residual, out.residual);
  out.column.setZero(count, static_cast<Eigen::Index>(series.column.size()));
  for (std::size_t k = 0; k < series.column.size(); ++k) {
    if (series.column[k].empty()) continue;
    pick(series.column[k], out.column.col(static_cast<Eigen::Index>(k)));
  }
  out.independent = 2.0 * static_cast<double>(band.last - band.first) /
                    static_cast<double>(series.residual.size());
  return out;
}

void apply(Rows& rows, const SpeedWeights& weights, const Values& speed) {
  for (std::size_t i = 0; i < speed.size(); ++i) {
    const double weight = weights.of(speed[i]);
    const auto row = static_cast<Eigen::Index>(i);
    rows.residual[row] *= weight;
    rows.column.row(row) *= weight;
  }
}

void set_blocks(Rows& rows, const Pair& pair, const std::vector<std::size_t>& at,
                std::size_t points) {
  const double spacing_s = pair.recorded.stretch.period_s *
                           static_cast<double>(pair.recorded.stretch.padded) /
                           static_cast<double>(points);
  const double span_s = spacing_s * static_cast<double>(at.size());
  const double wished_s = periods_per_block * pair.period_of_motion_s;
  const double blocks = std::max(std::floor(span_s / wished_s), static_cast<double>(fewest_blocks));
  for (std::size_t i = 0; i < at.size(); ++i) {
    rows.block.push_back(
        static_cast<std::size_t>(blocks * static_cast<double>(i) / static_cast<double>(at.size())));
  }
}

struct RowPair {
  Rows recorded;
  Rows simulated;
};

std::optional<RowPair> row_pair(const Pair& pair, std::size_t b) {
  constexpr std::size_t fewest_rows = 64;
  const BalanceBand& band = pair.bands[b];
  if (band.empty()) return std::nullopt;
  const std::size_t points = points_for(band);
  const auto at = interior(pair.recorded.stretch, points);
  if (at.size() < fewest_rows) return std::nullopt;
  const Values power = smooth_power(spectrum_of_values(pair.simulated.balance[b].residual), band,
                                    pair.simulated.stretch.bin_hz());
  RowPair out{rows_of(pair.recorded, b, band, power, at),
              rows_of(pair.simulated, b, band, power, at)};
  const Values speed = lowest_speed(pair.simulated, at, points);
  const SpeedWeights weights(speed, out.simulated.residual);
  apply(out.simulated, weights, speed);
  apply(out.recorded, weights, lowest_speed(pair.recorded, at, points));
  set_blocks(out.recorded, pair, at, points);
  out.simulated.block = out.recorded.block;
  return out;
}

// Shifts of the numbers that leave the least energy and prior penalty, none beyond `most` standard
// deviations from its declared value, which is `from` away.
Eigen::VectorXd best_shifts(std::span<const Rows* const> all, const Eigen::VectorXd& from,
                            double most) {
  const Eigen::Index count = from.size();
  Eigen::MatrixXd normal = Eigen::MatrixXd::Identity(count, count);
  Eigen::VectorXd slope = from;
  for (const Rows* rows : all) {
    normal += rows->independent * rows->column.transpose() * rows->column;
    slope += rows->independent * rows->column.transpose() * rows->residual;
  }
  std::vector<bool> held(static_cast<std::size_t>(count), false);
  Eigen::VectorXd shift = Eigen::VectorXd::Zero(count);
  for (Eigen::Index round = 0; round <= count; ++round) {
    Eigen::MatrixXd free = normal;
    Eigen::VectorXd right = -slope;
    for (Eigen::Index k = 0; k < count; ++k) {
      if (!held[static_cast<std::size_t>(k)]) continue;
      right -= normal.col(k) * shift[k];
    }
    for (Eigen::Index k = 0; k < count; ++k) {
      if (!held[static_cast<std::size_t>(k)]) continue;
      free.row(k).setZero();
      free.col(k).setZero();
      free(k, k) = 1.0;
      right[k] = shift[k];
    }
    shift = free.ldlt().solve(right);
    Eigen::Index farthest = 0;
    const double distance = (shift + from).cwiseAbs().maxCoeff(&farthest);
    if (!(distance > most * (1.0 + 1.0e-9))) break;
    held[static_cast<std::size_t>(farthest)] = true;
    shift[farthest] = std::copysign(most, shift[farthest] + from[farthest]) - from[farthest];
  }
  return shift;
}

// Energy by block after the shift.
Values block_energies(std::span<const Rows* const> all, const Eigen::VectorXd& shift) {
  Values out;
  for (const Rows* rows : all) {
    const std::size_t first = out.size();
    const Eigen::VectorXd left = rows->residual + rows->column * shift;
    out.resize(first + rows->block.back() + 1, 0.0);
    for (std::size_t i = 0; i < rows->block.size(); ++i) {
      out[first + rows->block[i]] += std::pow(left[static_cast<Eigen::Index>(i)], 2);
    }
  }
  return out;
}

// Probability that Student's t is larger.
double beyond_student(double t, double degrees) {
  return normal_chance(deviate_of_student(t, degrees));
}

// Of a larger ratio of the sums: jackknife over pairs of blocks.
double p_of_ratio(const Values& recorded, const Values& simulated) {
  const auto count = static_cast<double>(recorded.size());
  const double all = std::accumulate(recorded.begin(), recorded.end(), 0.0);
  const double null = std::accumulate(simulated.begin(), simulated.end(), 0.0);
  Values without;
  for (std::size_t i = 0; i < recorded.size(); ++i) {
    without.push_back(std::log((all - recorded[i]) / (null - simulated[i])));
  }
  const double mean = std::accumulate(without.begin(), without.end(), 0.0) / count;
  double square = 0.0;
  for (const double each : without) square += std::pow(each - mean, 2);
  const double error = std::sqrt(square * (count - 1.0) / count);
  return error > 0.0 ? beyond_student(std::log(all / null) / error, count - 1.0) : 1.0;
}

// Of a larger largest block, if all were distributed as those of the simulated recording.
double p_of_largest(const Values& recorded, const Values& simulated) {
  const auto count = static_cast<double>(simulated.size());
  double mean = 0.0;
  double square = 0.0;
  for (const double each : simulated) mean += std::log(each) / count;
  for (const double each : simulated) square += std::pow(std::log(each) - mean, 2);
  const double spread = std::sqrt(square / (count - 1.0) * (1.0 + 1.0 / count));
  const double largest = std::log(*std::max_element(recorded.begin(), recorded.end()));
  if (!(spread > 0.0)) return 1.0;
  return std::min(1.0, count * beyond_student((largest - mean) / spread, count - 1.0));
}

BalanceResidual compared(const Values& recorded, const Values& simulated) {
  BalanceResidual out;
  out.excess = std::accumulate(recorded.begin(), recorded.end(), 0.0) /
               std::accumulate(simulated.begin(), simulated.end(), 0.0);
  const double smaller =
      std::min(p_of_ratio(recorded, simulated), p_of_largest(recorded, simulated));
  out.p = std::clamp(2.0 * smaller, 1.0e-300, 1.0);
  return out;
}

// A balance over all recordings, with the shifts that it took.
struct Judged {
  std::optional<BalanceResidual> residual;
  Eigen::VectorXd recorded_shift;
  Eigen::VectorXd simulated_shift;
};

Judged judge(std::span<const Pair> pairs, std::size_t b, const Eigen::VectorXd& from, double most) {
  std::vector<RowPair> all;
  for (const Pair& pair : pairs) {
    if (auto rows = row_pair(pair, b)) all.push_back(std::move(*rows));
  }
  if (all.empty()) return {};
  std::vector<const Rows*> recorded;
  std::vector<const Rows*> simulated;
  for (const RowPair& each : all) {
    recorded.push_back(&each.recorded);
    simulated.push_back(&each.simulated);
  }
  Judged out;
  out.recorded_shift = best_shifts(recorded, from, most);
  out.simulated_shift = best_shifts(simulated, from, most);
  const Values energies = block_energies(recorded, out.recorded_shift);
  const Values floor = block_energies(simulated, out.simulated_shift);
  if (*std::min_element(floor.begin(), floor.end()) > 0.0 &&
      *std::min_element(energies.begin(), energies.end()) > 0.0) {
    out.residual = compared(energies, floor);
  }
  return out;
}

// A balance's residual after the shift, in the frequency domain, per point.
HalfSpectrum shifted(const BalanceSeries& series, const Eigen::VectorXd& shift) {
  Values values = series.residual;
  for (std::size_t k = 0; k < series.column.size(); ++k) {
    for (std::size_t j = 0; j < series.column[k].size(); ++j) {
      values[j] += shift[static_cast<Eigen::Index>(k)] * series.column[k][j];
    }
  }
  HalfSpectrum out = spectrum_of_values(values);
  for (Complex& each : out) each /= static_cast<double>(values.size());
  return out;
}

struct Moments {
  double force = 0.0;
  double friction = 0.0;
  double both = 0.0;
};

void add_moments(Moments& out, const HalfSpectrum& force, const HalfSpectrum& friction,
                 const Values& power, double sign) {
  for (std::size_t i = 0; i < power.size(); ++i) {
    if (!(power[i] > 0.0)) continue;
    out.force += sign * std::norm(force[i]) / power[i];
    out.friction += sign * std::norm(friction[i]) / power[i];
    out.both += sign * (std::conj(force[i]) * friction[i]).real() / power[i];
  }
}

// Of what both have beyond the simulated recording: its noise of the friction channel is common.
std::optional<double> common_share(std::span<const Pair> pairs, const Judged& force,
                                   const Judged& friction) {
  if (!force.residual || !friction.residual) return std::nullopt;
  const std::size_t m = index_of(Balance::force_balance);
  const std::size_t f = index_of(Balance::friction_law);
  Moments excess;
  for (const Pair& pair : pairs) {
    const BalanceBand band{0, std::min(pair.bands[m].last, pair.bands[f].last)};
    if (band.empty()) continue;
    const HalfSpectrum null_force = shifted(pair.simulated.balance[m], force.simulated_shift);
    const HalfSpectrum null_friction = shifted(pair.simulated.balance[f], friction.simulated_shift);
    const double bin_hz = pair.simulated.stretch.bin_hz();
    Values power = smooth_power(null_force, band, bin_hz);
    const Values other = smooth_power(null_friction, band, bin_hz);
    for (std::size_t i = 0; i < power.size(); ++i) power[i] += other[i];
    add_moments(excess, shifted(pair.recorded.balance[m], force.recorded_shift),
                shifted(pair.recorded.balance[f], friction.recorded_shift), power, 1.0);
    add_moments(excess, null_force, null_friction, power, -1.0);
  }
  const double smaller = std::min(excess.force, excess.friction);
  if (!(smaller > 0.0)) return std::nullopt;
  return std::clamp(excess.both / smaller, -1.0, 1.0);
}

}  // namespace

std::string_view name_of(Balance balance) {
  switch (balance) {
    case Balance::kinematics:
      return "kinematics";
    case Balance::force_balance:
      return "force_balance";
    case Balance::friction_law:
      return "friction_law";
    case Balance::normal_load:
      return "normal_load";
    case Balance::excitation:
      return "excitation";
  }
  return "";
}

Balances balances_of(const BalanceCase& measured, std::uint64_t seed, int threads,
                     const Criteria& criteria) {
  const Model model = within_priors(measured, criteria.contradicted_sigmas);
  const auto numbers = uncertain_numbers(model, measured.declared);
  Eigen::VectorXd from(static_cast<Eigen::Index>(numbers.size()));
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    from[static_cast<Eigen::Index>(k)] = numbers[k].second;
  }
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < measured.recordings.size(); ++i) {
    const Model own =
        measured.campaign ? physics::model_of(measured.campaign->runs[i], model) : model;
    pairs.push_back(pair_of(measured.recordings[i], measured.experiments[i], own, seed + i));
    const std::array<Observed*, 2> both = {&pairs.back().recorded, &pairs.back().simulated};
    set_balances(both, pairs.back().bands, own, numbers, threads);
  }
  std::array<Judged, balance_count> judged;
  parallel::for_each(balance_count, threads, [&](std::size_t b) {
    judged[b] = judge(pairs, b, from, criteria.contradicted_sigmas);
  });
  Balances out;
  for (std::size_t b = 0; b < balance_count; ++b) out.of[b] = judged[b].residual;
  out.force_and_friction = common_share(pairs, judged[index_of(Balance::force_balance)],
                                        judged[index_of(Balance::friction_law)]);
  return out;
}

}  // namespace stickslip::diagnosis
