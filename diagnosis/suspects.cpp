#include "diagnosis/suspects.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>

#include "diagnosis/parallel/for_each.h"
#include "diagnosis/spectrum.h"
#include "physics/effects/catalogue.h"

namespace stickslip::diagnosis {

namespace {

using std::numbers::pi;

bool is_compared(std::span<const Experiment> experiments, Channel channel) {
  return std::any_of(experiments.begin(), experiments.end(), [channel](const Experiment& e) {
    return ((e.compared >> index_of(channel)) & 1U) != 0;
  });
}

// The channel that drives the rig: its gain can be wrong too.
std::optional<Channel> driving(const physics::Model& model) {
  switch (model.oscillator.excitation) {
    case physics::Excitation::base:
      return Channel::base_displacement;
    case physics::Excitation::force:
      return Channel::drive_force;
    case physics::Excitation::imposed:
      return std::nullopt;
  }
  return std::nullopt;
}

// The whitened residuals of the first experiment on its time grid, 0 where there is none.
std::array<std::vector<double>, predicted_channels> residuals_of(const Task& task,
                                                                 const Hypothesis& hypothesis,
                                                                 const Fit& fitted) {
  const Experiment& e = task.experiments.front();
  std::array<std::vector<double>, predicted_channels> out;
  for (auto& each : out) each.assign(e.samples, 0.0);
  parallel::for_each(task.windows.size(), task.threads, [&](std::size_t w) {
    const WindowRef ref = task.windows[w];
    if (ref.experiment != 0) return;
    const Window& window = e.windows[ref.window];
    const auto readings = predict(e, window, window.end, hypothesis, fitted.z, fitted.state[w]);
    for (std::size_t k = window.begin; k < window.end; ++k) {
      for (std::size_t c = 0; c < predicted_channels; ++c) {
        if (((e.valid[k] >> c) & 1U) == 0) continue;
        const double r = (e.reading[k][c] - readings[k - window.begin][c]) / task.sigma[c];
        // One window that was not followed must not drown all others.
        if (std::isfinite(r)) out[c][k] = std::clamp(r, -100.0, 100.0);
      }
    }
  });
  return out;
}

// The lines that stand highest above their surroundings, strongest first.
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
      return ratio > 0.93 && ratio < 1.07;
    });
    if (!near) chosen.push_back(i);
  }
  return chosen;
}

// The stretch of windows whose excess over `threshold` sums to most.
std::pair<std::size_t, std::size_t> densest(const std::vector<double>& value, double threshold) {
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

// Where most of the readings beyond half of the largest magnitude lie: at the limit of a channel
// that saturates.
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

}  // namespace

std::string Suspect::name() const {
  std::string name(effect->card().id);
  if (place.channel) name += " of " + std::string(info(*place.channel).stem);
  if (place.from) name += " from " + std::string(info(*place.from).stem);
  return name;
}

std::vector<Suspect> suspects_of(const physics::Model& model,
                                 std::span<const Experiment> experiments) {
  std::vector<Suspect> suspects;
  const auto add = [&](const physics::Effect* effect, const physics::Place& place) {
    if (physics::can_be_missing(*effect, model, place)) suspects.push_back({effect, place});
  };
  for (const physics::Effect* effect : physics::catalogue()) {
    if (effect->card().relation != physics::Relation::sensor) {
      add(effect, {});
      continue;
    }
    for (const Channel channel : all_channels) {
      if (!is_compared(experiments, channel) && channel != driving(model)) continue;
      add(effect, {channel, std::nullopt});
      for (const Channel from : all_channels) {
        if (from != channel && is_compared(experiments, from)) add(effect, {channel, from});
      }
    }
  }
  return suspects;
}

Hints hints_of(const Task& task, const Hypothesis& hypothesis, const Fit& fitted) {
  Hints hints;
  const Experiment& e = task.experiments.front();
  const auto residuals = residuals_of(task, hypothesis, fitted);
  std::vector<double> together;
  double samples = 0.0;
  for (const WindowRef ref : task.windows) {
    if (ref.experiment != 0) continue;
    const Window& window = e.windows[ref.window];
    samples += static_cast<double>(window.end - window.begin);
  }
  double step_hz = 1.0;
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (((e.compared >> c) & 1U) == 0) continue;
    const auto spectrum = spectrum_of(residuals[c]);
    const std::size_t half = spectrum.size() / 2;
    step_hz = 1.0 / (e.period_s * static_cast<double>(spectrum.size()));
    std::vector<double> power(half);
    for (std::size_t i = 0; i < half; ++i) power[i] = std::norm(spectrum[i]);
    if (together.empty()) together.assign(half, 0.0);
    for (std::size_t i = 0; i < half; ++i) together[i] += power[i];
    // Hum is looked for above what the mass can follow.
    const auto from = static_cast<std::size_t>(15.0 / step_hz);
    const auto to = std::min(half, static_cast<std::size_t>(450.0 / step_hz));
    const auto found = peaks_of(power, from, to, 1);
    if (found.empty() || !(samples > 0.0)) continue;
    const std::size_t i = found.front();
    // The vertex of a parabola through the three highest points is nearer than the grid.
    const double left = std::sqrt(power[i - 1]);
    const double top = std::sqrt(power[i]);
    const double right = std::sqrt(power[i + 1]);
    const double bend = left - 2.0 * top + right;
    const double shift = bend < 0.0 ? std::clamp(0.5 * (left - right) / bend, -0.5, 0.5) : 0.0;
    physics::Line line;
    line.frequency_hz = (static_cast<double>(i) + shift) * step_hz;
    std::complex<double> sum = 0.0;
    for (std::size_t k = 0; k < residuals[c].size(); ++k) {
      const double t = e.period_s * static_cast<double>(k);
      sum += residuals[c][k] * std::polar(1.0, -2.0 * pi * line.frequency_hz * t);
    }
    line.amplitude = 2.0 * std::abs(sum) / samples * task.sigma[c];
    line.phase_rad = std::arg(sum) + 0.5 * pi;  // a sine, not a cosine
    hints.line[c] = line;
  }
  const auto from = static_cast<std::size_t>(0.5 / step_hz);
  const auto to = std::min(together.size(), static_cast<std::size_t>(120.0 / step_hz));
  for (const std::size_t i : peaks_of(together, from, to, 3)) {
    hints.frequencies_hz.push_back(static_cast<double>(i) * step_hz);
  }

  std::vector<double> by_window;
  std::vector<std::pair<double, double>> span;
  for (std::size_t w = 0; w < task.windows.size(); ++w) {
    const WindowRef ref = task.windows[w];
    if (ref.experiment != 0) continue;
    const Window& window = e.windows[ref.window];
    by_window.push_back(std::log(std::max(0.1, fitted.chi2[w] / std::max(1, fitted.count[w]))));
    span.emplace_back(e.period_s * static_cast<double>(window.begin),
                      e.period_s * static_cast<double>(window.end));
  }
  if (by_window.size() < 8) return hints;
  std::vector<double> sorted = by_window;
  std::sort(sorted.begin(), sorted.end());
  const double usual = sorted[sorted.size() / 2];
  const double most = sorted[sorted.size() * 19 / 20];
  for (const double share : {0.12, 0.3, 0.6}) {
    const auto [begin, end] = densest(by_window, usual + share * (most - usual) + 0.05);
    if (end - begin < 2 || end - begin > by_window.size() * 7 / 10) continue;
    const std::pair<double, double> episode{span[begin].first, span[end - 1].second};
    if (hints.episodes_s.empty() || hints.episodes_s.back() != episode) {
      hints.episodes_s.push_back(episode);
    }
  }
  return hints;
}

physics::Scales scales_of(std::span<const Experiment> experiments, const Hypothesis& hypothesis,
                          std::span<const double> z, const Hints& hints,
                          const physics::Place& place) {
  const Experiment& e = experiments.front();
  const auto parameters = hypothesis.parameters(z);
  const auto n = hypothesis.rig().numbers<double>(parameters);
  physics::Scales scales;
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
  const auto& structure = hypothesis.rig().structure();
  scales.friction_n = structure.friction ? n.c.mu * (structure.loaded ? e.mean_load_n : 1.0) : 0.0;
  scales.mean_load_n = e.mean_load_n;
  scales.duration_s = e.period_s * static_cast<double>(e.samples);
  scales.sample_period_s = e.period_s;
  scales.mass_kg = n.c.mass;
  scales.transition_speed_m_s = n.c.transition_speed;
  if (hypothesis.model().load_cell) {
    scales.cell_frequency_hz = hypothesis.model().load_cell->natural_frequency_hz.value;
    scales.cell_damping_ratio = hypothesis.model().load_cell->damping_ratio.value;
  }
  scales.lowest_load_n = 0.9 * e.mean_load_n;
  scales.highest_load_n = 1.1 * e.mean_load_n;
  if (e.channel_std[index_of(Channel::normal_load)] > 0.0) {
    const double reach = 2.0 * e.channel_std[index_of(Channel::normal_load)];
    scales.lowest_load_n = std::max(0.0, e.mean_load_n - reach);
    scales.highest_load_n = e.mean_load_n + reach;
  }
  scales.frequencies_hz = hints.frequencies_hz;
  scales.episodes_s = hints.episodes_s;
  const auto channel_scales = [&](const std::optional<Channel>& channel) {
    physics::ChannelScales out;
    if (!channel) return out;
    const std::size_t c = index_of(*channel);
    out.spread = std::max(e.channel_std[c], 1.0e-15);
    out.largest = 3.0 * out.spread;
    out.pile = out.largest;
    if (c < predicted_channels) {
      out.line = hints.line[c];
      double most = 0.0;
      for (const auto& reading : e.reading) most = std::max(most, std::abs(reading[c]));
      out.largest = std::max(most, 1.0e-15);
      out.pile = pile_of(e, c, out.largest);
    }
    return out;
  };
  scales.channel = channel_scales(place.channel);
  scales.from = channel_scales(place.from);
  return scales;
}

}  // namespace stickslip::diagnosis
