#include "diagnosis/regions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdio>
#include <numbers>
#include <random>
#include <unsupported/Eigen/FFT>

#include "diagnosis/drive_phase.h"
#include "diagnosis/parallel/for_each.h"

namespace stickslip::diagnosis {

namespace {

using std::numbers::pi;

constexpr std::size_t time_parts = 8;
constexpr std::size_t phase_parts = 8;
constexpr std::size_t motion_parts = 5;
constexpr double false_share = 0.05;

// What the residuals of one window add up to under one condition. `logarithm` is the sum of
// log(1 + r^2): a mean of squares would be decided by the few largest.
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

// The edges of five parts that hold as many samples each.
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
    const Experiment& first = task.experiments.front();
    // Times of different recordings have nothing in common.
    const std::size_t times = task.experiments.size() == 1 ? time_parts : 0;
    for (std::size_t i = 0; i < times; ++i) {
      const double from = first.time_s(i * first.samples / time_parts);
      const double to = first.time_s((i + 1) * first.samples / time_parts);
      list_.push_back({Aspect::time, from, to, printed("from %.3g to %.3g s", from, to)});
    }
    for (std::size_t i = 0; i < 5; ++i) {
      list_.push_back({Aspect::displacement, x_[i], x_[i + 1],
                       printed("at displacements from %.2g to %.2g m", x_[i], x_[i + 1])});
    }
    for (std::size_t i = 0; i < 5; ++i) {
      list_.push_back({Aspect::velocity, v_[i], v_[i + 1],
                       printed("at velocities from %.2g to %.2g m/s", v_[i], v_[i + 1])});
    }
    for (const char* words :
         {"while it hardly moves", "around reversals", "while it moves forwards",
          "while it moves backwards", "while it moves fast"}) {
      list_.push_back({Aspect::motion, 0.0, 0.0, words});
    }
    for (std::size_t i = 0; i < phase_parts; ++i) {
      const double from = 2.0 * pi * static_cast<double>(i) / phase_parts;
      const double to = 2.0 * pi * static_cast<double>(i + 1) / phase_parts;
      list_.push_back({Aspect::drive_phase, from, to,
                       printed("at drive phases from %.0f to %.0f degrees after its crest",
                               from * 180.0 / pi, to * 180.0 / pi)});
    }
    samples_ = list_.size();
    double from = 0.0;
    while (from < highest_hz) {
      const double to = std::min(std::max(2.0, 2.0 * from), highest_hz);
      list_.push_back({Aspect::band, from, to, printed("between %.3g and %.3g Hz", from, to)});
      from = to;
    }
  }

  const std::vector<Condition>& list() const { return list_; }
  /// The first so many are about samples, the others about lines of the spectrum.
  std::size_t of_samples() const { return samples_; }

  /// Calls visit(index of the condition) for all that sample k meets.
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
    visit(at + drive_[ref.experiment].part(k));
  }

 private:
  // In which part of its cycle the drive is.
  class Drive {
   public:
    explicit Drive(const Experiment& e) {
      for (const double phase : drive_phase_of(e).phase_rad) {
        part_.push_back(
            std::min(phase_parts - 1, static_cast<std::size_t>(phase / (2.0 * pi) * phase_parts)));
      }
    }
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

// By window: of every channel all samples, all lines, and those under each condition.
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
  for (std::size_t k = window.begin; k < window.end; ++k) {
    for (std::size_t c = 0; c < predicted_channels; ++c) {
      if (((e.valid[k] >> c) & 1U) == 0) continue;
      const double off = (readings[k - window.begin][c] - e.reading[k][c]) / task.sigma[c];
      const double r = std::isfinite(off) ? std::clamp(off, -1.0e6, 1.0e6) : 1.0e6;
      residual[c][k - window.begin] = r;
      out.samples[c].add(r * r);
      conditions.each_of(ref, k, [&](std::size_t i) { out.under[c][i].add(r * r); });
    }
  }
  Eigen::FFT<double> fft;
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    if (out.samples[c].count == 0.0) continue;
    std::vector<std::complex<double>> spectrum;
    fft.fwd(spectrum, residual[c]);
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

// Windows drawn anew in blocks of neighbours, as counts of how often each comes.
std::vector<std::vector<double>> redrawn(std::size_t windows, std::uint64_t seed) {
  constexpr std::size_t draws = 400;
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

}  // namespace

std::vector<Region> regions_of(const Task& task, const Hypothesis& hypothesis, const Fit& fitted,
                               std::uint64_t seed) {
  const std::size_t windows = task.windows.size();
  const Conditions conditions(task);
  std::vector<WindowSums> sums(windows);
  parallel::for_each(windows, task.threads, [&](std::size_t w) {
    sums[w] = sums_of(task, conditions, hypothesis, fitted, w);
  });
  const auto draws = redrawn(windows, seed);

  std::vector<Region> tested;
  constexpr double fewest = 30.0;  // samples or lines that a condition must have
  for (std::size_t c = 0; c < predicted_channels; ++c) {
    for (std::size_t i = 0; i < conditions.list().size(); ++i) {
      const auto& all_of = [&](std::size_t w) -> const Sums& {
        return i < conditions.of_samples() ? sums[w].samples[c] : sums[w].lines[c];
      };
      Sums in;
      Sums all;
      for (std::size_t w = 0; w < windows; ++w) {
        in += sums[w].under[c][i];
        all += all_of(w);
      }
      if (in.count < fewest || all.count - in.count < fewest) continue;
      double sum = 0.0;
      double square = 0.0;
      for (const auto& count : draws) {
        Sums drawn_in;
        Sums drawn_all;
        for (std::size_t w = 0; w < windows; ++w) {
          if (count[w] == 0.0) continue;
          const Sums& one = sums[w].under[c][i];
          drawn_in += {count[w] * one.logarithm, 0.0, count[w] * one.count};
          const Sums& whole = all_of(w);
          drawn_all += {count[w] * whole.logarithm, 0.0, count[w] * whole.count};
        }
        const double each = contrast(drawn_in, drawn_all);
        sum += each;
        square += each * each;
      }
      const double n = static_cast<double>(draws.size());
      const double error = std::sqrt(std::max(0.0, square / n - std::pow(sum / n, 2)));
      const double found = contrast(in, all);
      const Condition& condition = conditions.list()[i];
      Region region;
      region.channel = all_channels[c];
      region.aspect = condition.aspect;
      region.from = condition.from;
      region.to = condition.to;
      region.words = condition.words;
      const Sums out = all - in;
      region.energy = in.square / in.count;
      region.energy_outside = out.square / out.count;
      region.p_value = error > 0.0 ? 0.5 * std::erfc(found / error / std::numbers::sqrt2) : 1.0;
      tested.push_back(std::move(region));
    }
  }

  std::stable_sort(tested.begin(), tested.end(),
                   [](const Region& a, const Region& b) { return a.p_value < b.p_value; });
  double harmonic = 0.0;
  for (std::size_t k = 1; k <= tested.size(); ++k) harmonic += 1.0 / static_cast<double>(k);
  std::size_t named = 0;
  for (std::size_t k = 0; k < tested.size(); ++k) {
    const double allowed =
        false_share * static_cast<double>(k + 1) / (static_cast<double>(tested.size()) * harmonic);
    if (tested[k].p_value <= allowed) named = k + 1;
  }
  tested.erase(tested.begin() + static_cast<std::ptrdiff_t>(named), tested.end());
  // A condition under which most residuals are larger but the few largest are not would only
  // puzzle: what is told is the mean square.
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
