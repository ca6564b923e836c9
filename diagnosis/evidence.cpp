// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/evidence.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "diagnosis/drive_phase.h"
#include "diagnosis/fourier.h"
#include "diagnosis/median.h"
#include "diagnosis/parallel/for_each.h"

namespace stickslip::diagnosis {

namespace {

using std::numbers::pi;

constexpr std::size_t phase_parts = 24;
constexpr std::size_t shown_windows = 3;

// Bounds the residuals of windows in which the model diverged.
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
      if (!e.is_compared(k, c)) continue;
      residual[i] = bounded((readings[w][i][c] - e.reading[k][c]) / task.sigma_of(e, c));
    }
    const std::vector<std::complex<double>> spectrum = fourier(residual);
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

// Sums of squares before and after.
struct Squares {
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

// Indices of the task's windows of the first experiment, in order of time.
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

// All runs of `count` neighbouring held-out windows.
std::vector<Stretch> stretches_of(const std::vector<WindowEvidence>& windows, std::size_t count) {
  const auto follows = [&](std::size_t i) {
    const double gap = windows[i].begin_s - windows[i - 1].end_s;
    return windows[i].reported && gap < 0.5 * (windows[i].end_s - windows[i].begin_s);
  };
  std::vector<Stretch> out;
  for (std::size_t i = 0; i + count <= windows.size(); ++i) {
    if (!windows[i].reported) continue;
    std::size_t run = 1;
    double sum = windows[i].before;
    while (run < count && follows(i + run)) sum += windows[i + run++].before;
    if (run == count) out.push_back({i, count, sum / static_cast<double>(count)});
  }
  return out;
}

// Index of the part of [-reach, reach] that holds a value.
std::size_t cell_of(double value, double reach) {
  const double share = std::clamp(0.5 + 0.5 * value / reach, 0.0, 0.999999);
  return static_cast<std::size_t>(share * static_cast<double>(PhaseMap::cells));
}

// By window of the task, corrected for the error of the drive.
std::vector<Readings> readings_of(const Task& task, const FittedHypothesis& fitted) {
  std::vector<Readings> out(task.windows.size());
  parallel::for_each(out.size(), task.threads, [&](std::size_t w) {
    const Window& window = task.window(w);
    out[w] = predict(task.experiment(w), window, window.end, *fitted.hypothesis, fitted.z,
                     (*fitted.state)[w]);
  });
  return out;
}

// Collects the residuals of both hypotheses by channel, window, phase of the drive, and cell of
// phase space.
class Collector {
 public:
  Collector(const Task& task, const FittedHypothesis& before, const FittedHypothesis& after)
      : task_(task),
        e_(task.experiments.front()),
        before_(readings_of(task, before)),
        after_(readings_of(task, after)),
        order_(in_order_of_time(task)),
        drive_(drive_phase_of(e_)),
        by_cell_(PhaseMap::cells * PhaseMap::cells),
        by_window_(order_.size()) {
    map_.displacement_m = std::max(e_.largest.displacement_m, 1.0e-12);
    map_.velocity_m_s = std::max(e_.largest.velocity_m_s, 1.0e-12);
  }

  bool drive_is_periodic() const { return is_periodic(drive_, e_); }

  ChannelEvidence channel(std::size_t c) {
    ChannelEvidence out;
    out.channel = all_channels[c];
    out.sigma = task_.sigma_of(e_, c);
    std::vector<Squares> by_phase(phase_parts);
    for (std::size_t i = 0; i < order_.size(); ++i) {
      const Squares of_window = add_window(c, i, by_phase);
      const bool none = !(of_window.count > 0.0);
      const double nothing = std::numeric_limits<double>::quiet_NaN();
      out.window_before.push_back(none ? nothing : of_window.before / of_window.count);
      out.window_after.push_back(none ? nothing : of_window.after / of_window.count);
    }
    for (std::size_t i = 0; i < phase_parts; ++i) {
      out.phase_deg.push_back(360.0 * (static_cast<double>(i) + 0.5) / phase_parts);
      out.phase_before.push_back(root_mean(by_phase[i].before, by_phase[i].count));
      out.phase_after.push_back(root_mean(by_phase[i].after, by_phase[i].count));
    }
    out.power_before = mean_power(task_, before_, c, e_.period_s, out.frequency_hz);
    out.power_after = mean_power(task_, after_, c, e_.period_s, out.frequency_hz);
    return out;
  }

  // Of the channels so far.
  PhaseMap map() const {
    PhaseMap out = map_;
    for (const Squares& cell : by_cell_) {
      out.before.push_back(root_mean(cell.before, cell.count));
      out.after.push_back(root_mean(cell.after, cell.count));
    }
    return out;
  }

  // Of the channels so far.
  std::vector<WindowEvidence> windows() const {
    std::vector<WindowEvidence> out;
    for (std::size_t i = 0; i < order_.size(); ++i) {
      const Window& window = task_.window(order_[i]);
      WindowEvidence each;
      each.begin_s = e_.time_s(window.begin);
      each.end_s = e_.time_s(window.end);
      each.reported = window.use == Use::report;
      const WindowDrive drive = drive_in(drive_, window, e_.period_s);
      each.drive_hz = drive.frequency_hz;
      each.drive_amplitude = drive.amplitude;
      const double count = std::max(1.0, by_window_[i].count);
      each.before = by_window_[i].before / count;
      each.after = by_window_[i].after / count;
      out.push_back(each);
    }
    return out;
  }

  Traces traces(const Stretch& stretch, Channel channel) const {
    Traces out;
    const std::size_t c = index_of(channel);
    for (std::size_t i = stretch.first; i < stretch.first + stretch.count; ++i) {
      const std::size_t w = order_[i];
      const Window& window = task_.window(w);
      for (std::size_t k = window.begin; k < window.end; ++k) {
        if (!e_.is_compared(k, c)) continue;
        out.time_s.push_back(e_.time_s(k));
        out.recorded.push_back(e_.reading[k][c]);
        out.before.push_back(before_[w][k - window.begin][c]);
        out.after.push_back(after_[w][k - window.begin][c]);
      }
    }
    return out;
  }

 private:
  double whitened(const std::vector<Readings>& readings, std::size_t w, std::size_t k,
                  std::size_t c) const {
    const double reading = readings[w][k - task_.window(w).begin][c];
    return bounded((reading - e_.reading[k][c]) / task_.sigma_of(e_, c));
  }

  // Adds the residuals of channel c in the i-th window.
  Squares add_window(std::size_t c, std::size_t i, std::vector<Squares>& by_phase) {
    const std::size_t w = order_[i];
    const Window& window = task_.window(w);
    Squares of_window;
    for (std::size_t k = window.begin; k < window.end; ++k) {
      if (!e_.is_compared(k, c)) continue;
      const double r0 = whitened(before_, w, k, c);
      const double r1 = whitened(after_, w, k, c);
      of_window.add(r0, r1);
      by_window_[i].add(r0, r1);
      by_cell_[cell_of(e_.guess[k].velocity_m_s, map_.velocity_m_s) * PhaseMap::cells +
               cell_of(e_.guess[k].displacement_m, map_.displacement_m)]
          .add(r0, r1);
      const auto part = static_cast<std::size_t>(drive_.phase_rad[k] / (2.0 * pi) * phase_parts);
      by_phase[std::min(phase_parts - 1, part)].add(r0, r1);
    }
    return of_window;
  }

  const Task& task_;
  const Experiment& e_;
  std::vector<Readings> before_;
  std::vector<Readings> after_;
  std::vector<std::size_t> order_;
  DrivePhase drive_;
  PhaseMap map_;
  std::vector<Squares> by_cell_;
  std::vector<Squares> by_window_;
};

}  // namespace

// The stretch with the worst window is the worst, however few its neighbours are.
void choose_stretches(Evidence& out) {
  std::vector<Stretch> single = stretches_of(out.windows, 1);
  if (single.empty()) return;
  const auto less = [](const Stretch& a, const Stretch& b) { return a.before < b.before; };
  const Stretch worst = *std::max_element(single.begin(), single.end(), less);
  const auto middle = single.begin() + static_cast<std::ptrdiff_t>(single.size() / 2);
  std::nth_element(single.begin(), middle, single.end(), less);
  const Stretch typical = *middle;
  std::vector<double> each;
  for (const Stretch& window : single) each.push_back(window.before);
  out.median = median(std::move(each));
  const auto around = [&](const Stretch& window) {
    Stretch best = window;
    for (std::size_t count = 2; count <= shown_windows; ++count) {
      std::optional<Stretch> longer;
      for (const Stretch& run : stretches_of(out.windows, count)) {
        const bool has_it = run.first <= window.first && window.first < run.first + count;
        if (has_it && (!longer || less(*longer, run))) longer = run;
      }
      if (longer) best = *longer;
    }
    return best;
  };
  out.worst = around(worst);
  const auto overlaps = [&](const Stretch& one) {
    return one.first < out.worst.first + out.worst.count && out.worst.first < one.first + one.count;
  };
  out.typical = around(typical);
  if (!overlaps(out.typical)) return;
  out.worst = worst;
  out.typical = typical.first == worst.first ? Stretch{} : typical;
}

Evidence evidence_of(const Task& task, const FittedHypothesis& before,
                     const FittedHypothesis& after) {
  Evidence out;
  const Experiment& e = task.experiments.front();
  Collector collector(task, before, after);
  out.drive_is_periodic = collector.drive_is_periodic();
  out.drive_noise_removed = e.drive_noise > 0.0;
  out.driven_by = drive_channel(before.hypothesis->model().oscillator.excitation);
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (e.is_compared(c)) out.channels.push_back(collector.channel(c));
  }
  out.map = collector.map();
  out.windows = collector.windows();
  choose_stretches(out);
  for (ChannelEvidence& channel : out.channels) {
    channel.worst = collector.traces(out.worst, channel.channel);
    channel.typical = collector.traces(out.typical, channel.channel);
  }
  return out;
}

}  // namespace stickslip::diagnosis
