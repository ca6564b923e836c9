#include "tools/diagnose/evidence.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "tools/diagnose/drive_phase.h"
#include "tools/diagnose/median.h"
#include "tools/diagnose/residual_power.h"
#include "tools/parallel/for_each.h"

namespace stickslip::diagnosis {

namespace {

using std::numbers::pi;

constexpr std::size_t phase_parts = 24;
constexpr std::size_t shown_windows = 3;

// Takes out of the readings of a window what the base's noise would most probably have added to
// them: its knots, given the residuals.
void take_base_out(Readings& readings, const Task& task, std::size_t w, BaseResponse response) {
  const Experiment& e = task.experiments[task.windows[w].experiment];
  const Window& window = e.windows[task.windows[w].window];
  Eigen::VectorXd residual(response.rows());
  const auto each_row = [&](auto&& visit) {
    Eigen::Index row = 0;
    for (std::size_t k = window.begin; k < window.end; ++k) {
      for (std::size_t c = 0; c < predicted_channels; ++c) {
        if (((e.valid[k] >> c) & 1U) != 0) visit(row++, k, c);
      }
    }
  };
  each_row([&](Eigen::Index row, std::size_t k, std::size_t c) {
    response.row(row) /= task.sigma[c];
    residual[row] = (readings[k - window.begin][c] - e.reading[k][c]) / task.sigma[c];
  });
  if (!residual.allFinite()) return;
  using Square = Eigen::Matrix<double, base_knots, base_knots>;
  const Square information = Square::Identity() + response.transpose() * response;
  const Eigen::Matrix<double, base_knots, 1> knots =
      information.llt().solve(response.transpose() * residual);
  const Eigen::VectorXd share = response * knots;
  each_row([&](Eigen::Index row, std::size_t k, std::size_t c) {
    readings[k - window.begin][c] -= share[row] * task.sigma[c];
  });
}

std::vector<Readings> readings_of(const Task& task, const Explanation& explanation,
                                  bool& base_doubted) {
  const auto response =
      base_response_of(task, *explanation.hypothesis, explanation.z, *explanation.state);
  base_doubted = !response.empty();
  std::vector<Readings> readings(task.windows.size());
  parallel::for_each(task.windows.size(), task.threads, [&](std::size_t w) {
    const Experiment& e = task.experiments[task.windows[w].experiment];
    const Window& window = e.windows[task.windows[w].window];
    readings[w] = predict(e, window, window.end, *explanation.hypothesis, explanation.z,
                          (*explanation.state)[w]);
    if (base_doubted) take_base_out(readings[w], task, w, *response[w]);
  });
  return readings;
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
  const auto early = readings_of(task, before, out.base_doubted);
  const auto late = readings_of(task, after, out.base_doubted);
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
