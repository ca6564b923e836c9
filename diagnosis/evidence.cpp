#include "diagnosis/evidence.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <unsupported/Eigen/FFT>
#include <utility>

#include "diagnosis/base_noise.h"
#include "diagnosis/drive_phase.h"
#include "diagnosis/median.h"

namespace stickslip::diagnosis {

namespace {

using std::numbers::pi;

constexpr std::size_t phase_parts = 24;
constexpr std::size_t shown_windows = 3;

// A model that blew up in a window tells nothing more than that.
double bounded(double residual) {
  return std::isfinite(residual) ? std::clamp(residual, -1.0e6, 1.0e6) : 1.0e6;
}

std::vector<double> mean_power(const Task& task, const std::vector<Readings>& readings,
                               std::size_t c, double period_s, std::vector<double>& frequency_hz) {
  std::vector<double> power;
  double count = 0.0;
  for (std::size_t w = 0; w < task.windows.size(); ++w) {
    if (task.windows[w].experiment != 0) continue;
    const Experiment& e = task.experiments.front();
    const Window& window = e.windows[task.windows[w].window];
    const std::size_t n = window.end - window.begin;
    if (!power.empty() && n / 2 + 1 != power.size()) continue;
    std::vector<double> residual(n, 0.0);
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t k = window.begin + i;
      if (((e.valid[k] >> c) & 1U) == 0) continue;
      residual[i] = bounded((readings[w][i][c] - e.reading[k][c]) / task.sigma[c]);
    }
    Eigen::FFT<double> fft;
    std::vector<std::complex<double>> spectrum;
    fft.fwd(spectrum, residual);
    power.resize(n / 2 + 1, 0.0);
    for (std::size_t i = 0; i < power.size(); ++i) {
      power[i] += std::norm(spectrum[i]) / static_cast<double>(n);
    }
    count += 1.0;
  }
  frequency_hz.clear();
  for (std::size_t i = 0; i < power.size(); ++i) {
    power[i] /= std::max(1.0, count);
    frequency_hz.push_back(static_cast<double>(i) /
                           (2.0 * period_s * static_cast<double>(power.size() - 1)));
  }
  return power;
}

// A mean of squares before and after, as it grows.
struct Pair {
  double before = 0.0;
  double after = 0.0;
  double count = 0.0;

  void add(double r0, double r1) {
    before += r0 * r0;
    after += r1 * r1;
    count += 1.0;
  }
};

double root_mean(double sum, double count) {
  return count > 0.0 ? std::sqrt(sum / count) : std::numeric_limits<double>::quiet_NaN();
}

// The windows of the first experiment in the order of time, as indices into the task's.
std::vector<std::size_t> in_order_of_time(const Task& task) {
  std::vector<std::size_t> order;
  for (std::size_t w = 0; w < task.windows.size(); ++w) {
    if (task.windows[w].experiment == 0) order.push_back(w);
  }
  const Experiment& e = task.experiments.front();
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return e.windows[task.windows[a].window].begin < e.windows[task.windows[b].window].begin;
  });
  return order;
}

// How a window was driven.
void describe_drive(WindowEvidence& out, const Experiment& e, const Window& window,
                    const DrivePhase& drive) {
  double turned = 0.0;
  for (std::size_t k = window.begin; k < window.end; ++k) {
    out.drive_amplitude += drive.amplitude[k] / static_cast<double>(window.end - window.begin);
    if (k == window.begin) continue;
    turned += std::remainder(drive.phase_rad[k] - drive.phase_rad[k - 1], 2.0 * pi);
  }
  const auto steps = static_cast<double>(window.end - window.begin - 1);
  out.drive_hz = std::abs(turned) / (2.0 * pi * steps * e.period_s);
}

// Of the runs of neighbouring held-out windows, the one in which the declared model misses most.
Stretch stretch_of(const std::vector<WindowEvidence>& windows) {
  Stretch out;
  std::vector<double> held_out;
  for (const WindowEvidence& each : windows) {
    if (each.held_out) held_out.push_back(each.before);
  }
  if (held_out.empty()) return out;
  out.typical = median(std::move(held_out));
  const auto follows = [&](std::size_t i) {
    const double gap = windows[i].begin_s - windows[i - 1].end_s;
    return windows[i].held_out && gap < 0.5 * (windows[i].end_s - windows[i].begin_s);
  };
  double most = -1.0;
  for (std::size_t i = 0; i < windows.size(); ++i) {
    if (!windows[i].held_out) continue;
    std::size_t count = 1;
    double sum = windows[i].before;
    while (count < shown_windows && i + count < windows.size() && follows(i + count)) {
      sum += windows[i + count++].before;
    }
    // A longer run first, the larger misfit of as long ones second.
    if (count < out.count || (count == out.count && sum <= most)) continue;
    most = sum;
    out.first = i;
    out.count = count;
    out.before = sum / static_cast<double>(count);
  }
  return out;
}

Channel drive_channel_of(physics::Excitation excitation) {
  switch (excitation) {
    case physics::Excitation::force:
      return Channel::drive_force;
    case physics::Excitation::imposed:
      return Channel::displacement;
    case physics::Excitation::base:
      break;
  }
  return Channel::base_displacement;
}

}  // namespace

Evidence evidence_of(const Task& task, const Explanation& before, const Explanation& after) {
  Evidence out;
  const Experiment& e = task.experiments.front();
  const auto early = readings_of(task, *before.hypothesis, before.z, *before.state);
  const auto late = readings_of(task, *after.hypothesis, after.z, *after.state);
  out.base_doubted = e.base_doubt_m_s2 > 0.0;
  const auto order = in_order_of_time(task);
  const DrivePhase drive = drive_phase_of(e);
  out.driven_by = drive_channel_of(before.hypothesis->model().oscillator.excitation);
  const auto window_of = [&](std::size_t w) -> const Window& {
    return e.windows[task.windows[w].window];
  };

  constexpr std::size_t cells = PhaseMap::cells;
  out.map.displacement_m = std::max(e.largest.displacement_m, 1.0e-12);
  out.map.velocity_m_s = std::max(e.largest.velocity_m_s, 1.0e-12);
  std::vector<Pair> by_cell(cells * cells);
  const auto cell_of = [](double value, double reach) {
    const double share = std::clamp(0.5 + 0.5 * value / reach, 0.0, 0.999999);
    return static_cast<std::size_t>(share * static_cast<double>(cells));
  };
  std::vector<Pair> by_window(order.size());
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (((e.compared >> c) & 1U) == 0) continue;
    ChannelEvidence channel;
    channel.channel = all_channels[c];
    channel.sigma = task.sigma[c];
    std::vector<Pair> by_phase(phase_parts);
    for (std::size_t i = 0; i < order.size(); ++i) {
      const std::size_t w = order[i];
      const Window& window = window_of(w);
      Pair of_window;
      for (std::size_t k = window.begin; k < window.end; ++k) {
        if (((e.valid[k] >> c) & 1U) == 0) continue;
        const double r0 =
            bounded((early[w][k - window.begin][c] - e.reading[k][c]) / task.sigma[c]);
        const double r1 = bounded((late[w][k - window.begin][c] - e.reading[k][c]) / task.sigma[c]);
        of_window.add(r0, r1);
        by_window[i].add(r0, r1);
        by_cell[cell_of(e.guess[k].velocity_m_s, out.map.velocity_m_s) * cells +
                cell_of(e.guess[k].displacement_m, out.map.displacement_m)]
            .add(r0, r1);
        by_phase[std::min(phase_parts - 1,
                          static_cast<std::size_t>(drive.phase_rad[k] / (2.0 * pi) * phase_parts))]
            .add(r0, r1);
      }
      const bool none = !(of_window.count > 0.0);
      const double nothing = std::numeric_limits<double>::quiet_NaN();
      channel.window_before.push_back(none ? nothing : of_window.before / of_window.count);
      channel.window_after.push_back(none ? nothing : of_window.after / of_window.count);
    }
    for (std::size_t i = 0; i < phase_parts; ++i) {
      channel.phase_deg.push_back(360.0 * (static_cast<double>(i) + 0.5) / phase_parts);
      channel.phase_before.push_back(root_mean(by_phase[i].before, by_phase[i].count));
      channel.phase_after.push_back(root_mean(by_phase[i].after, by_phase[i].count));
    }
    channel.power_before = mean_power(task, early, c, e.period_s, channel.frequency_hz);
    channel.power_after = mean_power(task, late, c, e.period_s, channel.frequency_hz);
    out.channels.push_back(std::move(channel));
  }
  for (const Pair& cell : by_cell) {
    out.map.before.push_back(root_mean(cell.before, cell.count));
    out.map.after.push_back(root_mean(cell.after, cell.count));
  }
  for (std::size_t i = 0; i < order.size(); ++i) {
    const Window& window = window_of(order[i]);
    WindowEvidence each;
    each.begin_s = e.time_s(window.begin);
    each.end_s = e.time_s(window.end);
    each.held_out = window.held_out;
    describe_drive(each, e, window, drive);
    const double count = std::max(1.0, by_window[i].count);
    each.before = by_window[i].before / count;
    each.after = by_window[i].after / count;
    out.windows.push_back(each);
  }

  out.stretch = stretch_of(out.windows);
  for (std::size_t i = out.stretch.first; i < out.stretch.first + out.stretch.count; ++i) {
    const std::size_t w = order[i];
    const Window& window = window_of(w);
    for (ChannelEvidence& channel : out.channels) {
      const std::size_t c = index_of(channel.channel);
      for (std::size_t k = window.begin; k < window.end; ++k) {
        if (((e.valid[k] >> c) & 1U) == 0) continue;
        channel.time_s.push_back(e.time_s(k));
        channel.recorded.push_back(e.reading[k][c]);
        channel.before.push_back(early[w][k - window.begin][c]);
        channel.after.push_back(late[w][k - window.begin][c]);
      }
    }
  }
  return out;
}

}  // namespace stickslip::diagnosis
