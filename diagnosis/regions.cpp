// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/regions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdio>
#include <numbers>
#include <random>

#include "diagnosis/drive_phase.h"
#include "diagnosis/fourier.h"
#include "diagnosis/parallel/for_each.h"
#include "diagnosis/significance.h"

namespace stickslip::diagnosis {

namespace {

using std::numbers::pi;

constexpr std::size_t time_parts = 8;
constexpr std::size_t phase_parts = 8;
constexpr std::size_t motion_parts = 5;

// Sums over the residuals of one window under one condition. `logarithm` is the sum of log(1 +
// r^2): a mean of squares would depend on the few largest residuals.
struct Sums {
  double logarithm = 0.0;
  double square = 0.0;
  double count = 0.0;

  void add(double r_squared) {
    logarithm += std::log1p(r_squared);
    square += r_squared;
    count += 1.0;
  }
  Sums& operator+=(const Sums& other) {
    logarithm += other.logarithm;
    square += other.square;
    count += other.count;
    return *this;
  }
  friend Sums operator-(Sums a, const Sums& b) {
    a.logarithm -= b.logarithm;
    a.square -= b.square;
    a.count -= b.count;
    return a;
  }
};

struct Condition {
  Aspect aspect;
  double from = 0.0;
  double to = 0.0;
  std::string words;
};

std::string printed(const char* format, auto... values) {
  char text[160];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

// Quintiles.
std::array<double, 6> fifths(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  std::array<double, 6> edges{};
  for (std::size_t i = 0; i < edges.size(); ++i) {
    edges[i] = values[std::min(values.size() - 1, i * values.size() / 5)];
  }
  return edges;
}

std::size_t part_of(const std::array<double, 6>& edges, double value) {
  std::size_t part = 0;
  while (part < 4 && value >= edges[part + 1]) ++part;
  return part;
}

class Conditions {
 public:
  explicit Conditions(const Task& task) : task_(task) {
    std::vector<double> x;
    std::vector<double> v;
    double highest_hz = 0.0;
    for (const WindowRef ref : task.windows) {
      const Experiment& e = task.experiments[ref.experiment];
      const Window& window = e.windows[ref.window];
      for (std::size_t k = window.begin; k < window.end; ++k) {
        x.push_back(e.guess[k].displacement_m);
        v.push_back(e.guess[k].velocity_m_s);
      }
      highest_hz = std::max(highest_hz, 0.5 / e.period_s);
    }
    x_ = fifths(std::move(x));
    v_ = fifths(std::move(v));
    for (const Experiment& e : task.experiments) drive_.push_back(Drive(e));
    add_times();
    add_quintiles();
    add_motions();
    if (std::any_of(drive_.begin(), drive_.end(), [](const Drive& d) { return d.has_phase(); })) {
      add_drive_phases();
    }
    samples_ = list_.size();
    add_bands(highest_hz);
  }

  const std::vector<Condition>& list() const { return list_; }
  /// Number of conditions on samples; the following ones are on spectral lines.
  std::size_t of_samples() const { return samples_; }

  /// Calls visit(index) for every condition that sample k meets.
  template <class Visit>
  void each_of(const WindowRef ref, std::size_t k, Visit&& visit) const {
    const Experiment& e = task_.experiments[ref.experiment];
    std::size_t at = 0;
    if (task_.experiments.size() == 1) {
      visit(std::min(time_parts - 1, k * time_parts / e.samples));
      at += time_parts;
    }
    const double x = e.guess[k].displacement_m;
    const double v = e.guess[k].velocity_m_s;
    visit(at + part_of(x_, x));
    at += 5;
    visit(at + part_of(v_, v));
    at += 5;
    const double slow = 0.03 * e.largest.velocity_m_s;
    const double fast = 0.5 * e.largest.velocity_m_s;
    if (std::abs(v) < slow) visit(at);
    const auto near = static_cast<std::size_t>(std::lround(0.02 / e.period_s));
    const std::size_t before = k > near ? k - near : 0;
    const std::size_t after = std::min(e.samples - 1, k + near);
    if (e.guess[before].velocity_m_s * e.guess[after].velocity_m_s < 0.0) visit(at + 1);
    if (v >= slow) visit(at + 2);
    if (v <= -slow) visit(at + 3);
    if (std::abs(v) > fast) visit(at + 4);
    at += motion_parts;
    const Drive& drive = drive_[ref.experiment];
    if (drive.has_phase()) visit(at + drive.part(k));
  }

 private:
  void add_times() {
    // Times of different recordings are unrelated.
    if (task_.experiments.size() != 1) return;
    const Experiment& e = task_.experiments.front();
    for (std::size_t i = 0; i < time_parts; ++i) {
      const double from = e.time_s(i * e.samples / time_parts);
      const double to = e.time_s((i + 1) * e.samples / time_parts);
      list_.push_back({Aspect::time, from, to, printed("at times from %.3g to %.3g s", from, to)});
    }
  }

  void add_quintiles() {
    for (std::size_t i = 0; i < 5; ++i) {
      list_.push_back({Aspect::displacement, x_[i], x_[i + 1],
                       printed("at displacements from %.2g to %.2g m", x_[i], x_[i + 1])});
    }
    for (std::size_t i = 0; i < 5; ++i) {
      list_.push_back({Aspect::velocity, v_[i], v_[i + 1],
                       printed("at velocities from %.2g to %.2g m/s", v_[i], v_[i + 1])});
    }
  }

  void add_motions() {
    for (const char* words :
         {"while it hardly moves", "around reversals", "while it moves forwards",
          "while it moves backwards", "while it moves fast"}) {
      list_.push_back({Aspect::motion, 0.0, 0.0, words});
    }
  }

  void add_drive_phases() {
    for (std::size_t i = 0; i < phase_parts; ++i) {
      const double from = 2.0 * pi * static_cast<double>(i) / phase_parts;
      const double to = 2.0 * pi * static_cast<double>(i + 1) / phase_parts;
      list_.push_back({Aspect::drive_phase, from, to,
                       printed("at drive phases from %.0f to %.0f degrees after its crest",
                               from * 180.0 / pi, to * 180.0 / pi)});
    }
  }

  void add_bands(double highest_hz) {
    double from = 0.0;
    while (from < highest_hz) {
      const double to = std::min(std::max(2.0, 2.0 * from), highest_hz);
      list_.push_back(
          {Aspect::band, from, to, printed("at frequencies between %.3g and %.3g Hz", from, to)});
      from = to;
    }
  }

  // Part of the drive's cycle, by sample, where it has cycles.
  class Drive {
   public:
    explicit Drive(const Experiment& e) {
      const DrivePhase drive = drive_phase_of(e);
      if (!is_periodic(drive, e)) return;
      for (const double phase : drive.phase_rad) {
        part_.push_back(
            std::min(phase_parts - 1, static_cast<std::size_t>(phase / (2.0 * pi) * phase_parts)));
      }
    }
    bool has_phase() const { return !part_.empty(); }
    std::size_t part(std::size_t k) const { return part_[k]; }

   private:
    std::vector<std::size_t> part_;
  };

  const Task& task_;
  std::array<double, 6> x_{};
  std::array<double, 6> v_{};
  std::vector<Drive> drive_;
  std::vector<Condition> list_;
  std::size_t samples_ = 0;
};

// Of one window: by channel all samples, all spectral lines, and those under each condition.
struct WindowSums {
  std::array<Sums, predicted_channels> samples;
  std::array<Sums, predicted_channels> lines;
  std::array<std::vector<Sums>, predicted_channels> under;
};

WindowSums sums_of(const Task& task, const Conditions& conditions, const Hypothesis& hypothesis,
                   const Fit& fitted, std::size_t w) {
  const WindowRef ref = task.windows[w];
  const Experiment& e = task.experiments[ref.experiment];
  const Window& window = e.windows[ref.window];
  const auto readings = predict(e, window, window.end, hypothesis, fitted.z, fitted.state[w]);
  WindowSums out;
  std::array<std::vector<double>, predicted_channels> residual;
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    out.under[c].resize(conditions.list().size());
    residual[c].assign(window.end - window.begin, 0.0);
  }
  for_each_compared(e, window.begin, window.end, [&](std::size_t k, std::size_t c) {
    const double off = (readings[k - window.begin][c] - e.reading[k][c]) / task.sigma_of(e, c);
    const double r = std::isfinite(off) ? std::clamp(off, -1.0e6, 1.0e6) : 1.0e6;
    residual[c][k - window.begin] = r;
    out.samples[c].add(r * r);
    conditions.each_of(ref, k, [&](std::size_t i) { out.under[c][i].add(r * r); });
  });
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (out.samples[c].count == 0.0) continue;
    const std::vector<std::complex<double>> spectrum = fourier(residual[c]);
    const auto n = static_cast<double>(residual[c].size());
    for (std::size_t i = 1; 2 * i < spectrum.size(); ++i) {
      const double power = std::norm(spectrum[i]) / n;
      const double hz = static_cast<double>(i) / (n * e.period_s);
      out.lines[c].add(power);
      for (std::size_t k = conditions.of_samples(); k < conditions.list().size(); ++k) {
        const Condition& band = conditions.list()[k];
        if (hz >= band.from && hz < band.to) out.under[c][k].add(power);
      }
    }
  }
  return out;
}

// Block bootstrap: by draw, the number of times that each window is drawn.
std::vector<std::vector<double>> bootstrap_counts(std::size_t windows, std::size_t draws,
                                                  std::uint64_t seed) {
  const auto block = std::max<std::size_t>(
      1, static_cast<std::size_t>(std::lround(std::cbrt(static_cast<double>(windows)))));
  std::mt19937_64 random(seed);
  std::uniform_int_distribution<std::size_t> first(0, windows - 1);
  std::vector<std::vector<double>> out(draws, std::vector<double>(windows, 0.0));
  for (auto& count : out) {
    for (std::size_t drawn = 0; drawn < windows;) {
      const std::size_t begin = first(random);
      for (std::size_t i = 0; i < block && drawn < windows; ++i, ++drawn) {
        count[(begin + i) % windows] += 1.0;
      }
    }
  }
  return out;
}

double contrast(const Sums& in, const Sums& all) {
  const Sums out = all - in;
  if (in.count < 1.0 || out.count < 1.0) return 0.0;
  return in.logarithm / in.count - out.logarithm / out.count;
}

// Residuals of one channel, with and without one condition, by window.
class Test {
 public:
  Test(const std::vector<WindowSums>& windows, const Conditions& conditions, std::size_t channel,
       std::size_t condition)
      : windows_(windows),
        channel_(channel),
        condition_(condition),
        of_samples_(condition < conditions.of_samples()) {
    for (std::size_t w = 0; w < windows.size(); ++w) {
      inside_ += inside(w);
      all_ += all(w);
    }
  }

  const Sums& inside() const { return inside_; }
  Sums outside() const { return all_ - inside_; }

  // One-sided, of the contrast over its bootstrap error.
  double p_value(const std::vector<std::vector<double>>& draws) const {
    const double error = bootstrap_error(draws);
    const double found = contrast(inside_, all_);
    return error > 0.0 ? normal_chance(found / error) : 1.0;
  }

 private:
  const Sums& inside(std::size_t w) const { return windows_[w].under[channel_][condition_]; }
  const Sums& all(std::size_t w) const {
    return of_samples_ ? windows_[w].samples[channel_] : windows_[w].lines[channel_];
  }

  double bootstrap_error(const std::vector<std::vector<double>>& draws) const {
    double sum = 0.0;
    double square = 0.0;
    for (const auto& count : draws) {
      Sums drawn_in;
      Sums drawn_all;
      for (std::size_t w = 0; w < windows_.size(); ++w) {
        if (count[w] == 0.0) continue;
        const Sums& one = inside(w);
        drawn_in += {count[w] * one.logarithm, 0.0, count[w] * one.count};
        const Sums& whole = all(w);
        drawn_all += {count[w] * whole.logarithm, 0.0, count[w] * whole.count};
      }
      const double each = contrast(drawn_in, drawn_all);
      sum += each;
      square += each * each;
    }
    const double n = static_cast<double>(draws.size());
    return std::sqrt(std::max(0.0, square / n - std::pow(sum / n, 2)));
  }

  const std::vector<WindowSums>& windows_;
  std::size_t channel_;
  std::size_t condition_;
  bool of_samples_;
  Sums inside_;
  Sums all_;
};

Region region_of(const Condition& condition, std::size_t channel, const Test& test,
                 const std::vector<std::vector<double>>& draws) {
  Region region;
  region.channel = all_channels[channel];
  region.aspect = condition.aspect;
  region.from = condition.from;
  region.to = condition.to;
  region.words = condition.words;
  region.energy = test.inside().square / test.inside().count;
  region.energy_outside = test.outside().square / test.outside().count;
  region.p_value = test.p_value(draws);
  return region;
}

// Keeps the significant regions, by the procedure of Benjamini and Yekutieli.
void keep_significant(std::vector<Region>& tested, double false_discovery_rate) {
  std::stable_sort(tested.begin(), tested.end(),
                   [](const Region& a, const Region& b) { return a.p_value < b.p_value; });
  double harmonic = 0.0;
  for (std::size_t k = 1; k <= tested.size(); ++k) harmonic += 1.0 / static_cast<double>(k);
  std::size_t kept = 0;
  for (std::size_t k = 0; k < tested.size(); ++k) {
    const double allowed = false_discovery_rate * static_cast<double>(k + 1) /
                           (static_cast<double>(tested.size()) * harmonic);
    if (tested[k].p_value <= allowed) kept = k + 1;
  }
  tested.erase(tested.begin() + static_cast<std::ptrdiff_t>(kept), tested.end());
}

}  // namespace

std::vector<Region> regions_of(const Task& task, const Hypothesis& hypothesis, const Fit& fitted,
                               std::uint64_t seed, const Criteria& criteria) {
  const std::size_t windows = task.windows.size();
  const Conditions conditions(task);
  std::vector<WindowSums> sums(windows);
  parallel::for_each(windows, task.threads, [&](std::size_t w) {
    sums[w] = sums_of(task, conditions, hypothesis, fitted, w);
  });
  const auto draws = bootstrap_counts(windows, criteria.effort.region_bootstrap_draws, seed);
  const double least = criteria.region_least_count;
  std::vector<Region> tested;
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    for (std::size_t i = 0; i < conditions.list().size(); ++i) {
      const Test test(sums, conditions, c, i);
      if (test.inside().count < least || test.outside().count < least) continue;
      tested.push_back(region_of(conditions.list()[i], c, test, draws));
    }
  }
  keep_significant(tested, criteria.region_false_discovery_rate);
  // The mean square is reported: it would contradict a condition under which most residuals are
  // larger but the few largest are not.
  std::erase_if(tested, [](const Region& each) { return each.energy <= each.energy_outside; });
  return tested;
}

std::string_view name_of(Aspect aspect) {
  switch (aspect) {
    case Aspect::time:
      return "time";
    case Aspect::displacement:
      return "displacement";
    case Aspect::velocity:
      return "velocity";
    case Aspect::motion:
      return "motion";
    case Aspect::drive_phase:
      return "drive_phase";
    case Aspect::band:
      return "band";
  }
  return "";
}

}  // namespace stickslip::diagnosis
