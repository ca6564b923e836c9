// SPDX-License-Identifier: Apache-2.0
#include "tools/reduction/reduction.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include "diagnosis/channel_readings.h"
#include "diagnosis/wide_band.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "physics/sensor_chain.h"

namespace stickslip::reduction {

namespace {

using Values = std::vector<double>;

constexpr std::size_t samples_of_the_paper = 800;
constexpr std::size_t fewest_samples = 32;
constexpr double min_load = 0.05;  // of the mean load, for a coefficient of friction
constexpr double end_s = 0.1;      // settling time of two Butterworth filters of order 4 at 25 Hz

[[noreturn]] void refuse(const std::string& source, const std::string& message) {
  throw InputError(Problem{source, 0, 0, message});
}

double mean_of(const Values& values) {
  double sum = 0.0;
  for (const double each : values) sum += each;
  return sum / static_cast<double>(values.size());
}

double largest_of(const Values& values) {
  double most = 0.0;
  for (const double each : values) most = std::max(most, std::abs(each));
  return most;
}

// The values without their straight line a + b i.
Values without_drift(Values values) {
  const double n = static_cast<double>(values.size());
  const double middle = 0.5 * (n - 1.0);
  const double mean = mean_of(values);
  double slope = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    slope += (static_cast<double>(i) - middle) * (values[i] - mean);
  }
  slope /= n * (n * n - 1.0) / 12.0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    values[i] -= mean + slope * (static_cast<double>(i) - middle);
  }
  return values;
}

// Power of one tone in values that are `period_s` apart, of which a hundred per second suffice for
// tones up to 20 Hz.
double power_at(const Values& values, double period_s, double frequency_hz) {
  const auto stride = std::max<std::size_t>(1, static_cast<std::size_t>(0.01 / period_s));
  double in_phase = 0.0;
  double quadrature = 0.0;
  for (std::size_t i = 0; i < values.size(); i += stride) {
    const double phase = 2.0 * std::numbers::pi * frequency_hz * period_s * static_cast<double>(i);
    in_phase += values[i] * std::cos(phase);
    quadrature += values[i] * std::sin(phase);
  }
  return in_phase * in_phase + quadrature * quadrature;
}

// The strongest tone between half a hertz and 20 Hz.
double strongest_tone_hz(const Values& values, double period_s) {
  const double duration_s = period_s * static_cast<double>(values.size());
  double best = 0.0;
  double most = -1.0;
  const double fine = 0.25 / duration_s;
  const double lowest = std::max(0.5, 1.0 / duration_s);
  const double highest = std::min(20.0, 0.4 / period_s);
  const auto steps = static_cast<int>(std::max(0.0, (highest - lowest) / fine));
  for (int k = 0; k <= steps; ++k) {
    const double f = lowest + fine * k;
    const double power = power_at(values, period_s, f);
    if (power > most) {
      most = power;
      best = f;
    }
  }
  return best;
}

constexpr std::array needed{Channel::displacement, Channel::velocity, Channel::friction_force,
                            Channel::normal_load, Channel::base_displacement};

// Consecutive samples with every needed channel: [begin, end).
struct Stretch {
  std::size_t begin = 0;
  std::size_t end = 0;
  std::size_t length() const { return end - begin; }
};

std::vector<Stretch> stretches_of(const std::vector<Frame>& frames, double period_s) {
  std::vector<Stretch> out;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const bool whole = std::all_of(needed.begin(), needed.end(),
                                   [&](Channel channel) { return frames[i].has(channel); });
    if (!whole) continue;
    const bool follows =
        !out.empty() && out.back().end == i &&
        static_cast<double>(frames[i].time_ns - frames[i - 1].time_ns) * 1.0e-9 < 1.5 * period_s;
    if (follows) {
      out.back().end = i + 1;
    } else {
      out.push_back({i, i + 1});
    }
  }
  return out;
}

Values column(const protocol::Recording& recording, Channel channel, const Stretch& stretch) {
  Values values;
  values.reserve(stretch.length());
  for (std::size_t i = stretch.begin; i < stretch.end; ++i) {
    values.push_back(recording.frames[i][channel]);
  }
  return values;
}

// The quantity behind the readings of an instrument whose gain, offset or delay is declared.
Values corrected(Values readings, const physics::Sensor& sensor, double period_s) {
  const double gain = sensor.gain ? sensor.gain->value : 1.0;
  const double offset = sensor.offset ? sensor.offset->value : 0.0;
  for (double& each : readings) each = (each - offset) / gain;
  const double late = sensor.delay_s ? sensor.delay_s->value / period_s : 0.0;
  if (late == 0.0) return readings;
  Values out;
  out.reserve(readings.size());
  const double last = static_cast<double>(readings.size() - 1);
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const double at = std::clamp(static_cast<double>(i) + late, 0.0, last);
    out.push_back(diagnosis::interpolated(readings, at, 0, readings.size()));
  }
  return out;
}

double quantile(Values values, double share) {
  if (values.empty()) return 0.0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// The signals that either method yields, by sample.
struct Signals {
  Values x;
  Values v;
  Values base;
  Values force;  // on the mass
  Values load;
  double inertia = 0.0;  // largest m_l b''
};

Signals as_read(const std::array<Values, channel_count>& read, double cell_mass, double drive_hz) {
  Signals out;
  out.x = read[index_of(Channel::displacement)];
  out.v = read[index_of(Channel::velocity)];
  out.load = read[index_of(Channel::normal_load)];
  out.base = without_drift(read[index_of(Channel::base_displacement)]);
  out.force = without_drift(read[index_of(Channel::friction_force)]);
  // Eq. (1): f = alpha S - m_l Omega^2 a cos(Omega t), where a cos(Omega t) is the input.
  const double inertia = cell_mass * std::pow(2.0 * std::numbers::pi * drive_hz, 2);
  for (std::size_t i = 0; i < out.force.size(); ++i) out.force[i] -= inertia * out.base[i];
  out.inertia = inertia * largest_of(out.base);
  return out;
}

Signals deconvolved(const std::array<Values, channel_count>& read, const physics::Model& model,
                    double period_s) {
  const auto wide_band = [&](Channel channel) {
    const physics::Sensor& sensor = model.sensors[index_of(channel)];
    const physics::FilterChain chain(sensor.filters, period_s);
    const Values& values = read[index_of(channel)];
    return diagnosis::wide_band(values, period_s, chain,
                                sensor.noise_std.value_or(diagnosis::noise_of(values)));
  };
  const auto x = wide_band(Channel::displacement);
  const auto signal = wide_band(Channel::friction_force);
  const auto base = wide_band(Channel::base_displacement);
  const physics::LoadCell& cell = *model.load_cell;
  const double omega = 2.0 * std::numbers::pi * cell.natural_frequency_hz.value;
  const bool resonant = cell.dynamics == physics::LoadCellDynamics::resonant;
  Signals out;
  out.x = x.value;
  out.v = x.rate;
  out.base = base.value;
  out.load = wide_band(Channel::normal_load).value;
  for (std::size_t i = 0; i < out.x.size(); ++i) {
    // m_l y'' + c_l y' + k_l y - f = -m_l b'', and the channel reads S = k_l y.
    const double inertia = cell.mass_kg.value * base.acceleration[i];
    double force = signal.value[i] + inertia;
    if (resonant) {
      force += 2.0 * cell.damping_ratio.value / omega * signal.rate[i] +
               signal.acceleration[i] / (omega * omega);
    }
    out.force.push_back(force);
    out.inertia = std::max(out.inertia, std::abs(inertia));
  }
  return out;
}

struct Bins {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  std::size_t count = 1;

  void include(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  std::size_t of(double value) const {
    const double share = high > low ? (value - low) / (high - low) : 0.0;
    return std::min(count - 1, static_cast<std::size_t>(share * static_cast<double>(count)));
  }
  double centre(std::size_t k) const {
    return low + (high - low) * (static_cast<double>(k) + 0.5) / static_cast<double>(count);
  }
};

// Sums over the samples of one cell, over its visits that have ended, and over the current visit.
struct CellSums {
  Cell cell;
  double sum = 0.0;
  double square = 0.0;
  double visit_sum = 0.0;
  double visit_square = 0.0;
  double present_sum = 0.0;
  std::size_t present_count = 0;

  void add(double mu) {
    sum += mu;
    square += mu * mu;
    ++cell.samples;
    present_sum += mu;
    ++present_count;
  }
  void end_visit() {
    if (present_count == 0) return;
    const double mean = present_sum / static_cast<double>(present_count);
    visit_sum += mean;
    visit_square += mean * mean;
    ++cell.visits;
    present_sum = 0.0;
    present_count = 0;
  }
};

double standard_deviation(double sum, double square, double n) {
  return n > 1.0 ? std::sqrt(std::max(0.0, (square - sum * sum / n) / (n - 1.0))) : 0.0;
}

Cell finished(const CellSums& sums) {
  Cell cell = sums.cell;
  const auto visits = static_cast<double>(cell.visits);
  cell.mu = sums.visit_sum / visits;
  cell.scatter = standard_deviation(sums.sum, sums.square, static_cast<double>(cell.samples));
  cell.standard_error =
      visits > 1.0
          ? standard_deviation(sums.visit_sum, sums.visit_square, visits) / std::sqrt(visits)
          : cell.scatter;
  return cell;
}

std::vector<Cell> surface_of(const std::vector<Sample>& samples, std::size_t bins) {
  Bins x{.count = bins};
  Bins v{.count = bins};
  for (const Sample& sample : samples) {
    x.include(sample.displacement_m);
    v.include(sample.velocity_m_s);
  }
  std::map<std::pair<std::size_t, std::size_t>, CellSums> cells;
  CellSums* last = nullptr;
  for (const Sample& sample : samples) {
    if (!std::isfinite(sample.mu)) continue;
    const auto i = x.of(sample.displacement_m);
    const auto j = v.of(sample.velocity_m_s);
    CellSums& sums = cells[{i, j}];
    if (&sums != last && last != nullptr) last->end_visit();
    last = &sums;
    sums.cell.displacement_m = x.centre(i);
    sums.cell.velocity_m_s = v.centre(j);
    sums.add(sample.mu);
  }
  if (last != nullptr) last->end_visit();
  std::vector<Cell> out;
  for (const auto& [at, sums] : cells) out.push_back(finished(sums));
  return out;
}

void summarise(Reduction& out, double sliding_share) {
  double fastest = 0.0;
  out.normal_load_n = {std::numeric_limits<double>::infinity(),
                       -std::numeric_limits<double>::infinity()};
  double sum_x = 0.0;
  double sum_n = 0.0;
  for (const Sample& s : out.samples) {
    fastest = std::max(fastest, std::abs(s.velocity_m_s));
    out.normal_load_n.low = std::min(out.normal_load_n.low, s.normal_load_n);
    out.normal_load_n.high = std::max(out.normal_load_n.high, s.normal_load_n);
    sum_x += s.displacement_m;
    sum_n += s.normal_load_n;
  }
  const auto count = static_cast<double>(out.samples.size());
  const double mean_x = sum_x / count;
  const double mean_n = sum_n / count;
  double xx = 0.0;
  double xn = 0.0;
  double nn = 0.0;
  std::size_t opposite = 0;
  Values sliding;
  for (const Sample& s : out.samples) {
    const double x = s.displacement_m - mean_x;
    const double n = s.normal_load_n - mean_n;
    xx += x * x;
    xn += x * n;
    nn += n * n;
    if (!std::isfinite(s.mu)) continue;
    if (s.mu * s.velocity_m_s < 0.0 && std::abs(s.velocity_m_s) > 0.02 * fastest) ++opposite;
    if (std::abs(s.velocity_m_s) > sliding_share * fastest)
      sliding.push_back(std::copysign(1.0, s.velocity_m_s) * s.mu);
  }
  const double slope = xx > 0.0 ? xn / xx : 0.0;
  out.load_n = mean_n - slope * mean_x;
  out.slope_per_m = out.load_n != 0.0 ? slope / out.load_n : 0.0;
  out.linear_share = xx > 0.0 && nn > 0.0 ? xn * xn / (xx * nn) : 0.0;
  out.negative_friction = static_cast<double>(opposite) / count;
  out.sliding_mu = {quantile(sliding, 0.10), quantile(sliding, 0.90)};
}

void check_reducible(const protocol::Recording& recording, const physics::Model& model) {
  if (!model.load_cell) {
    refuse(recording.source,
           "cannot be reduced with a model without [load_cell]: its mass enters Eq. (1)");
  }
  if (model.oscillator.excitation != physics::Excitation::base) {
    refuse(recording.source,
           "cannot be reduced with a model that is not base-excited "
           "(excitation = \"base\"): Eq. (1) subtracts the base's inertia");
  }
  const std::vector<Frame>& frames = recording.frames;
  for (const Channel channel : needed) {
    if (std::none_of(frames.begin(), frames.end(),
                     [&](const Frame& frame) { return frame.has(channel); })) {
      refuse(recording.source, "lacks the channel " + std::string(info(channel).column) +
                                   ", which the coefficient of friction is computed from");
    }
  }
  if (frames.size() < 2) refuse(recording.source, "holds one sample: nothing to reduce");
}

// The samples to reduce, and the stretch without gaps around them.
struct Selection {
  Stretch stretch;
  std::size_t first = 0;
  std::size_t count = 0;
};

Selection selection_of(const protocol::Recording& recording, const Options& options,
                       double period_s) {
  const std::vector<Stretch> stretches = stretches_of(recording.frames, period_s);
  const bool whole = options.method == Method::deconvolved;
  const std::size_t end = whole ? static_cast<std::size_t>(end_s / period_s) : 0;
  // The stretch with the first sample asked for, or the longest.
  const auto chosen = options.first
                          ? std::find_if(stretches.begin(), stretches.end(),
                                         [&](const Stretch& s) { return s.end > *options.first; })
                          : std::max_element(stretches.begin(), stretches.end(),
                                             [](const Stretch& a, const Stretch& b) {
                                               return a.length() < b.length();
                                             });
  Selection out;
  if (chosen != stretches.end()) out.stretch = *chosen;
  out.first = std::max(options.first.value_or(0), out.stretch.begin + end);
  const std::size_t available =
      out.stretch.end > out.first + end ? out.stretch.end - out.first - end : 0;
  out.count = options.samples.value_or(whole ? available : samples_of_the_paper);
  if (out.count < fewest_samples || out.count > available) {
    refuse(recording.source, "offers " + std::to_string(available) +
                                 " samples without a gap from sample " + std::to_string(out.first) +
                                 " on; expected " +
                                 std::to_string(std::max(out.count, fewest_samples)) +
                                 ": record longer, or ask for fewer with --samples (at least " +
                                 std::to_string(fewest_samples) + ")");
  }
  return out;
}

}  // namespace

Reduction reduce(const protocol::Recording& recording, const physics::Model& model,
                 const Options& options) {
  check_reducible(recording, model);
  const std::vector<Frame>& frames = recording.frames;
  const double period_s = protocol::median_period_s(frames);
  const auto [stretch, first, count] = selection_of(recording, options, period_s);
  const bool whole = options.method == Method::deconvolved;
  // Filters are inverted over the whole stretch: its ends are the least accurate part.
  const Stretch taken = whole ? stretch : Stretch{first, first + count};
  std::array<Values, channel_count> read;
  for (const Channel channel : needed) {
    const std::size_t c = index_of(channel);
    read[c] = corrected(column(recording, channel, taken), model.sensors[c], period_s);
  }

  Reduction out;
  out.first = first;
  out.period_s = period_s;
  out.drive_hz = options.drive_hz.value_or(
      strongest_tone_hz(without_drift(read[index_of(Channel::base_displacement)]), period_s));
  const Signals signals = whole ? deconvolved(read, model, period_s)
                                : as_read(read, model.load_cell->mass_kg.value, out.drive_hz);
  const double mean_load = mean_of(signals.load);
  if (!(mean_load > 0.0)) {
    refuse(recording.source,
           "has a mean normal_load_n of " + physics::number_text(mean_load) +
               " N over these samples; expected more than 0, for mu = f / N: is the gauge "
               "connected, and has its calibration the right sign?");
  }
  double largest_force = 0.0;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = first - taken.begin + k;
    Sample s;
    s.time_s = frames[first + k].time_s();
    s.displacement_m = signals.x[i];
    s.velocity_m_s = signals.v[i];
    s.base_displacement_m = signals.base[i];
    s.friction_force_n = signals.force[i];
    s.normal_load_n = signals.load[i];
    s.mu = s.normal_load_n > min_load * mean_load ? s.friction_force_n / s.normal_load_n
                                                  : std::numeric_limits<double>::quiet_NaN();
    largest_force = std::max(largest_force, std::abs(s.friction_force_n));
    out.samples.push_back(s);
  }
  out.inertia_share = largest_force > 0.0 ? signals.inertia / largest_force : 0.0;
  out.surface = surface_of(out.samples, std::max<std::size_t>(1, options.bins));
  summarise(out, options.sliding_share);
  return out;
}

}  // namespace stickslip::reduction
