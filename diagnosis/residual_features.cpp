// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/residual_features.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <optional>

#include "diagnosis/parallel/for_each.h"
#include "diagnosis/spectrum.h"

namespace stickslip::diagnosis {

namespace {

using std::numbers::pi;

// Hum is searched above the frequencies that the mass can follow.
constexpr double hum_from_hz = 15.0;
constexpr double hum_to_hz = 450.0;
constexpr double peaks_from_hz = 0.5;
constexpr double peaks_to_hz = 120.0;
constexpr std::size_t peaks = 3;
// Ratio of frequencies within which two peaks count as one.
constexpr double same_peak_low = 0.93;
constexpr double same_peak_high = 1.07;
constexpr std::size_t min_windows_for_episodes = 8;
// Thresholds of an episode between the median and the 95 % quantile of the log mean squares.
constexpr std::array episode_levels = {0.12, 0.3, 0.6};

using ChannelResiduals = std::array<std::vector<double>, predicted_channels>;

// Whitened residuals of the first experiment on its time grid, 0 where there are none.
ChannelResiduals residuals_on_grid(const Task& task, const Hypothesis& hypothesis,
                                   const Fit& fitted) {
  const Experiment& e = task.experiments.front();
  ChannelResiduals out;
  // Gaps have their length, so that the phase of a hum goes on behind them, unless that is more
  // than the recording's.
  const double periods = e.duration_s() / e.period_s;
  const bool gaps_last = periods < 4.0 * static_cast<double>(e.samples);
  const auto place = [&](std::size_t k) {
    return gaps_last ? static_cast<std::size_t>(std::llround(e.elapsed_s(k) / e.period_s)) : k;
  };
  const std::size_t length = std::max(e.samples, place(e.samples - 1) + 1);
  for (auto& each : out) each.assign(length, 0.0);
  parallel::for_each(task.windows.size(), task.threads, [&](std::size_t w) {
    if (task.windows[w].experiment != 0) return;
    const Window& window = task.window(w);
    const auto readings = predict(e, window, window.end, hypothesis, fitted.z, fitted.state[w]);
    const std::size_t first = place(window.begin);
    for_each_compared(e, window.begin, window.end, [&](std::size_t k, std::size_t c) {
      const double r = (e.reading[k][c] - readings[k - window.begin][c]) / task.sigma_of(e, c);
      // Bounded, so that one diverged window does not hide all others.
      if (std::isfinite(r)) out[c][first + k - window.begin] = std::clamp(r, -100.0, 100.0);
    });
  });
  return out;
}

// The strongest local maxima, strongest first.
std::vector<std::size_t> peaks_of(const std::vector<double>& power, std::size_t from,
                                  std::size_t to, std::size_t count) {
  std::vector<std::size_t> order;
  for (std::size_t i = std::max<std::size_t>(from, 1); i + 1 < to; ++i) {
    if (power[i] >= power[i - 1] && power[i] > power[i + 1]) order.push_back(i);
  }
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return power[a] > power[b]; });
  std::vector<std::size_t> chosen;
  for (const std::size_t i : order) {
    if (chosen.size() == count) break;
    const bool near = std::any_of(chosen.begin(), chosen.end(), [i](std::size_t j) {
      const double ratio = static_cast<double>(i) / static_cast<double>(j);
      return ratio > same_peak_low && ratio < same_peak_high;
    });
    if (!near) chosen.push_back(i);
  }
  return chosen;
}

// The range of windows with the largest sum of excesses over `threshold`.
std::pair<std::size_t, std::size_t> largest_excess(const std::vector<double>& value,
                                                   double threshold) {
  std::pair<std::size_t, std::size_t> best{0, 0};
  double most = 0.0;
  double sum = 0.0;
  std::size_t begin = 0;
  for (std::size_t i = 0; i < value.size(); ++i) {
    if (sum <= 0.0) {
      sum = 0.0;
      begin = i;
    }
    sum += value[i] - threshold;
    if (sum > most) {
      most = sum;
      best = {begin, i + 1};
    }
  }
  return best;
}

// Mode of the readings beyond half of the largest magnitude: the limit of a saturated channel.
double pile_of(const Experiment& e, std::size_t c, double largest) {
  constexpr std::size_t bins = 50;
  std::array<std::size_t, bins + 1> count{};
  for (const auto& reading : e.reading) {
    const double share = 2.0 * std::abs(reading[c]) / largest - 1.0;
    if (share >= 0.0) ++count[static_cast<std::size_t>(share * bins)];
  }
  const auto most = std::max_element(count.begin(), count.end()) - count.begin();
  return 0.5 * largest * (1.0 + (static_cast<double>(most) + 0.5) / bins);
}

// Number of samples in the task's windows of the first experiment.
double sample_count(const Task& task) {
  double samples = 0.0;
  for (std::size_t w = 0; w < task.windows.size(); ++w) {
    if (task.windows[w].experiment != 0) continue;
    samples += static_cast<double>(task.window(w).end - task.window(w).begin);
  }
  return samples;
}

// Vertex of the parabola through a maximum and its neighbours, in bins from the maximum.
double vertex_shift(const std::vector<double>& power, std::size_t i) {
  const double left = std::sqrt(power[i - 1]);
  const double top = std::sqrt(power[i]);
  const double right = std::sqrt(power[i + 1]);
  const double bend = left - 2.0 * top + right;
  return bend < 0.0 ? std::clamp(0.5 * (left - right) / bend, -0.5, 0.5) : 0.0;
}

// The line at a maximum of the power; its amplitude is in units of the residual.
physics::Line line_at(const std::vector<double>& residual, const std::vector<double>& power,
                      std::size_t i, double step_hz, double period_s, double samples) {
  physics::Line line;
  line.frequency_hz = (static_cast<double>(i) + vertex_shift(power, i)) * step_hz;
  std::complex<double> sum = 0.0;
  for (std::size_t k = 0; k < residual.size(); ++k) {
    const double t = period_s * static_cast<double>(k);
    sum += residual[k] * std::polar(1.0, -2.0 * pi * line.frequency_hz * t);
  }
  line.amplitude = 2.0 * std::abs(sum) / samples;
  line.phase_rad = std::arg(sum) + 0.5 * pi;  // a sine, not a cosine
  return line;
}

void set_lines(const Task& task, const ChannelResiduals& residuals, ResidualFeatures& out) {
  const Experiment& e = task.experiments.front();
  const double samples = sample_count(task);
  std::vector<double> total;  // power of all channels
  double step_hz = 1.0;
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (!e.is_compared(c)) continue;
    const auto spectrum = spectrum_of(residuals[c]);
    const std::size_t half = spectrum.size() / 2;
    step_hz = 1.0 / (e.period_s * static_cast<double>(spectrum.size()));
    std::vector<double> power(half);
    for (std::size_t i = 0; i < half; ++i) power[i] = std::norm(spectrum[i]);
    if (total.empty()) total.assign(half, 0.0);
    for (std::size_t i = 0; i < half; ++i) total[i] += power[i];
    const auto from = static_cast<std::size_t>(hum_from_hz / step_hz);
    const auto to = std::min(half, static_cast<std::size_t>(hum_to_hz / step_hz));
    const auto found = peaks_of(power, from, to, 1);
    if (found.empty() || !(samples > 0.0)) continue;
    out.line[c] = line_at(residuals[c], power, found.front(), step_hz, e.period_s, samples);
    out.line[c].amplitude *= task.sigma[c];
  }
  const auto from = static_cast<std::size_t>(peaks_from_hz / step_hz);
  const auto to = std::min(total.size(), static_cast<std::size_t>(peaks_to_hz / step_hz));
  for (const std::size_t i : peaks_of(total, from, to, peaks)) {
    out.frequencies_hz.push_back(static_cast<double>(i) * step_hz);
  }
}

void set_episodes(const Task& task, const Fit& fitted, ResidualFeatures& out) {
  const Experiment& e = task.experiments.front();
  std::vector<double> by_window;  // logarithm of the mean square
  std::vector<std::pair<double, double>> span;
  for (std::size_t w = 0; w < task.windows.size(); ++w) {
    if (task.windows[w].experiment != 0) continue;
    const Window& window = task.window(w);
    by_window.push_back(std::log(std::max(0.1, fitted.chi2[w] / std::max(1, fitted.count[w]))));
    span.emplace_back(e.elapsed_s(window.begin), e.elapsed_s(window.end));
  }
  if (by_window.size() < min_windows_for_episodes) return;
  std::vector<double> sorted = by_window;
  std::sort(sorted.begin(), sorted.end());
  const double typical = sorted[sorted.size() / 2];
  const double most = sorted[sorted.size() * 19 / 20];
  for (const double level : episode_levels) {
    const auto [begin, end] = largest_excess(by_window, typical + level * (most - typical) + 0.05);
    if (end - begin < 2 || end - begin > by_window.size() * 7 / 10) continue;
    const std::pair<double, double> episode{span[begin].first, span[end - 1].second};
    if (out.episodes_s.empty() || out.episodes_s.back() != episode) {
      out.episodes_s.push_back(episode);
    }
  }
}

physics::ChannelScales channel_scales(const Experiment& e, const ResidualFeatures& features,
                                      const std::optional<Channel>& channel) {
  physics::ChannelScales out;
  if (!channel) return out;
  const std::size_t c = index_of(*channel);
  out.spread = std::max(e.channel_std[c], 1.0e-15);
  out.largest = 3.0 * out.spread;
  out.pile = out.largest;
  if (c < predicted_channels) {
    out.line = features.line[c];
    double most = 0.0;
    for (const auto& reading : e.reading) most = std::max(most, std::abs(reading[c]));
    out.largest = std::max(most, 1.0e-15);
    out.pile = pile_of(e, c, out.largest);
  }
  return out;
}

void set_load_range(const Experiment& e, physics::Scales& scales) {
  scales.lowest_load_n = 0.9 * e.mean_load_n;
  scales.highest_load_n = 1.1 * e.mean_load_n;
  if (e.channel_std[index_of(Channel::normal_load)] > 0.0) {
    const double reach = 2.0 * e.channel_std[index_of(Channel::normal_load)];
    scales.lowest_load_n = std::max(0.0, e.mean_load_n - reach);
    scales.highest_load_n = e.mean_load_n + reach;
  }
}

// Sizes of motion and forces.
void set_motion_scales(const Experiment& e, const physics::RigNumbers<double>& n,
                       physics::Scales& scales) {
  scales.displacement_m = std::max(e.largest.displacement_m, 1.0e-12);
  double square = 0.0;
  double drive = 0.0;
  for (const StateGuess& guess : e.guess) square += guess.velocity_m_s * guess.velocity_m_s;
  for (const physics::Input& input : e.input) {
    drive = std::max(
        {drive, std::abs(input.drive_force_n), n.c.mass * std::abs(input.base_acceleration_m_s2)});
  }
  scales.velocity_m_s = std::max(std::sqrt(square / static_cast<double>(e.samples)), 1.0e-9);
  scales.stiffness_n_m = n.c.stiffness;
  scales.force_n =
      std::max({drive, n.c.stiffness * scales.displacement_m, e.largest.friction_n, 1.0e-12});
}

ResidualFeatures features_of_first(const Task& task, const Hypothesis& hypothesis,
                                   const Fit& fitted) {
  ResidualFeatures out;
  set_lines(task, residuals_on_grid(task, hypothesis, fitted), out);
  set_episodes(task, fitted, out);
  return out;
}

ResidualFeatures features_of_recording(const Task& task, std::size_t recording,
                                       const Hypothesis& hypothesis, const Fit& fitted) {
  Task own = task;
  own.experiments = task.experiments.subspan(recording, 1);
  own.windows.clear();
  Fit part;
  part.z = fitted.z;
  for (std::size_t w = 0; w < task.windows.size(); ++w) {
    if (task.windows[w].experiment != recording) continue;
    own.windows.push_back({0, task.windows[w].window});
    part.state.push_back(fitted.state[w]);
    part.chi2.push_back(fitted.chi2[w]);
    part.count.push_back(fitted.count[w]);
  }
  return own.windows.empty() ? ResidualFeatures{} : features_of_first(own, hypothesis, part);
}

physics::Scales scales_in(const Experiment& e, const Hypothesis& hypothesis,
                          std::span<const double> z, const ResidualFeatures& features,
                          const physics::Place& place) {
  const auto parameters = hypothesis.parameters(z, e.recording);
  const auto n = hypothesis.rig().numbers<double>(parameters);
  physics::Scales scales;
  set_motion_scales(e, n, scales);
  const auto& structure = hypothesis.rig().structure();
  scales.friction_n = structure.friction ? n.c.mu * (structure.loaded ? e.mean_load_n : 1.0) : 0.0;
  scales.mean_load_n = e.mean_load_n;
  scales.duration_s = e.duration_s();
  scales.sample_period_s = e.period_s;
  scales.mass_kg = n.c.mass;
  scales.transition_speed_m_s = n.c.transition_speed;
  if (hypothesis.model().load_cell) {
    scales.cell_frequency_hz = hypothesis.model().load_cell->natural_frequency_hz.value;
    scales.cell_damping_ratio = hypothesis.model().load_cell->damping_ratio.value;
  }
  set_load_range(e, scales);
  scales.frequencies_hz = features.frequencies_hz;
  scales.episodes_s = features.episodes_s;
  scales.channel = channel_scales(e, features, place.channel);
  scales.from = channel_scales(e, features, place.from);
  return scales;
}

// Magnitudes of both recordings: the larger motion, all loads.
void widen(physics::Scales& out, const physics::Scales& other) {
  for (const auto magnitude :
       {&physics::Scales::displacement_m, &physics::Scales::velocity_m_s, &physics::Scales::force_n,
        &physics::Scales::friction_n, &physics::Scales::duration_s,
        &physics::Scales::sample_period_s, &physics::Scales::highest_load_n}) {
    out.*magnitude = std::max(out.*magnitude, other.*magnitude);
  }
  out.lowest_load_n = std::min(out.lowest_load_n, other.lowest_load_n);
  for (const auto part : {&physics::Scales::channel, &physics::Scales::from}) {
    physics::ChannelScales& channel = out.*part;
    for (const auto magnitude : {&physics::ChannelScales::largest, &physics::ChannelScales::spread,
                                 &physics::ChannelScales::pile}) {
      channel.*magnitude = std::max(channel.*magnitude, (other.*part).*magnitude);
    }
  }
}

}  // namespace

ResidualFeatures residual_features(const Task& task, const Hypothesis& hypothesis,
                                   const Fit& fitted) {
  if (hypothesis.recordings() == 1) return features_of_first(task, hypothesis, fitted);
  ResidualFeatures out;
  for (std::size_t i = 0; i < task.experiments.size(); ++i) {
    const ResidualFeatures own = features_of_recording(task, i, hypothesis, fitted);
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      if (own.line[c].amplitude > out.line[c].amplitude) out.line[c] = own.line[c];
    }
    out.frequencies_hz.insert(out.frequencies_hz.end(), own.frequencies_hz.begin(),
                              own.frequencies_hz.end());
    out.episodes_s.insert(out.episodes_s.end(), own.episodes_s.begin(), own.episodes_s.end());
  }
  // Each frequency is a start of every effect that has one.
  const auto same = [](double a, double b) {
    return a / b > same_peak_low && a / b < same_peak_high;
  };
  auto& all = out.frequencies_hz;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto after = all.begin() + static_cast<std::ptrdiff_t>(i) + 1;
    all.erase(std::remove_if(after, all.end(), [&](double each) { return same(each, all[i]); }),
              all.end());
  }
  return out;
}

physics::Scales scales_of(std::span<const Experiment> experiments, const Hypothesis& hypothesis,
                          std::span<const double> z, const ResidualFeatures& features,
                          const physics::Place& place) {
  physics::Scales out = scales_in(experiments.front(), hypothesis, z, features, place);
  if (hypothesis.recordings() == 1) return out;
  double log_load = 0.0;
  for (const Experiment& e : experiments) {
    widen(out, scales_in(e, hypothesis, z, features, place));
    log_load += std::log(std::max(e.mean_load_n, 1.0e-12));
  }
  out.mean_load_n = std::exp(log_load / static_cast<double>(experiments.size()));
  return out;
}

}  // namespace stickslip::diagnosis
