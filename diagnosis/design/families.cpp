// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/design/families.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "physics/number_text.h"

namespace stickslip::design {

namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;
constexpr double taper_s = 0.5;
// Of the limits: the spline through the samples and the shaker overshoot a little.
constexpr double reserve = 0.95;
constexpr double smallest_amplitude = 0.02;  // of the largest
constexpr int multisine_lines = 5;

double between(double low, double high, double share) { return low + share * (high - low); }
double between_logs(double low, double high, double share) {
  return low * std::pow(high / low, share);
}

// u^3 (10 - 15 u + 6 u^2): the acceleration begins and ends at 0.
double smooth_step(double u) {
  u = std::clamp(u, 0.0, 1.0);
  return u * u * u * (10.0 + u * (6.0 * u - 15.0));
}

// 1 from the end of one taper to the beginning of the other, 0 outside.
double window(double time_s, double length_s, double taper) {
  if (time_s <= 0.0 || time_s >= length_s) return 0.0;
  return smooth_step(std::min(time_s, length_s - time_s) / taper);
}

struct Numbers {
  double moving_s = 0.0;  // without the rests before and after
  double hz = 0.0;
  double other_hz = 0.0;  // of a sweep or a multisine, its other end
  double depth = 0.0;
  double slow_hz = 0.0;
  double burst_s = 0.0;
  double rest_s = 0.0;
};

Numbers numbers_of(const RunPlan& run, const RunRange& range) {
  Numbers out;
  out.moving_s =
      between(range.shortest_s, range.longest_s, run.duration) - rest_before_s - rest_after_s;
  out.hz = between_logs(range.lowest_hz, range.highest_hz, run.shape[0]);
  out.other_hz = between_logs(range.lowest_hz, range.highest_hz, run.shape[1]);
  out.depth = run.shape[1];
  out.slow_hz = between_logs(1.0 / out.moving_s, 0.5, run.shape[2]);
  out.burst_s = between_logs(1.5, std::max(2.0, 0.4 * out.moving_s), run.shape[1]);
  out.rest_s = between_logs(0.3, std::max(0.6, 0.4 * out.moving_s), run.shape[2]);
  if (run.family == Family::hold) {
    out.rest_s = between(0.3, 0.7, run.shape[2]) * out.moving_s;
    out.burst_s = 0.5 * (out.moving_s - out.rest_s);
  }
  return out;
}

// Share of the amplitude in one of four equal steps, which tapers join.
double steps(double time_s, const Numbers& n) {
  const double length_s = 0.25 * n.moving_s;
  const auto level = [&](double step) {
    const double rising = between(1.0 - n.depth, 1.0, std::clamp(step, 0.0, 3.0) / 3.0);
    return std::max(rising, smallest_amplitude);
  };
  const double step = std::floor(time_s / length_s);
  const double into = smooth_step((time_s - step * length_s) / taper_s);
  return between(level(step - 1.0), level(step), into);
}

double burst(double time_s, const Numbers& n) {
  const double length_s = n.burst_s + n.rest_s;
  const double into = std::fmod(time_s, length_s);
  return window(into, n.burst_s, taper_s) * std::sin(two_pi * n.hz * into);
}

double sweep(double time_s, const Numbers& n) {
  const double ratio = n.other_hz / n.hz;
  if (std::abs(ratio - 1.0) < 1.0e-3) return std::sin(two_pi * n.hz * time_s);
  const double rate = std::log(ratio) / n.moving_s;
  // Amplitude falls as the frequency rises, so that the acceleration does not.
  const double hz = n.hz * std::exp(rate * time_s);
  const double level = std::min(n.hz, n.other_hz) / hz;
  return level * std::sin(two_pi * n.hz / rate * (std::exp(rate * time_s) - 1.0));
}

double sines(double time_s, const Numbers& n, double turn) {
  double sum = 0.0;
  for (int k = 0; k < multisine_lines; ++k) {
    const double share = static_cast<double>(k) / (multisine_lines - 1);
    const double hz = between_logs(n.hz, n.other_hz, share);
    const double phase = -std::numbers::pi * k * (k + 1) / multisine_lines + two_pi * turn * k;
    sum += n.hz / hz * std::sin(two_pi * hz * time_s + phase);
  }
  return sum;
}

// Of unit size, from the beginning of the motion.
double unit_drive(const RunPlan& run, const Numbers& n, double time_s) {
  switch (run.family) {
    case Family::modulated:
      return (1.0 - n.depth * (0.5 - 0.5 * std::cos(two_pi * n.slow_hz * time_s))) *
             std::sin(two_pi * n.hz * time_s);
    case Family::stepped:
      return steps(time_s, n) * std::sin(two_pi * n.hz * time_s);
    case Family::sweep:
      return sweep(time_s, n);
    case Family::bursts:
    case Family::hold:
      return burst(time_s, n);
    case Family::multisine:
      return sines(time_s, n, run.shape[2]);
  }
  return 0.0;
}

constexpr std::array usual = {
    RunPlan{Family::modulated, 1.0, 0.5, {0.55, 0.9, 0.3}},
    RunPlan{Family::modulated, 0.6, 0.5, {0.45, 0.9, 0.3}},
    RunPlan{Family::modulated, 0.9, 0.5, {0.3, 0.9, 0.3}},
    RunPlan{Family::stepped, 1.0, 0.5, {0.6, 0.9, 0.5}},
    RunPlan{Family::sweep, 1.0, 0.5, {0.2, 0.8, 0.5}},
    RunPlan{Family::sweep, 0.6, 0.5, {0.8, 0.2, 0.5}},
    RunPlan{Family::bursts, 1.0, 0.5, {0.55, 0.3, 0.6}},
    RunPlan{Family::bursts, 0.8, 0.5, {0.4, 0.2, 0.9}},
    RunPlan{Family::hold, 0.9, 0.6, {0.4, 0.5, 0.5}},
    RunPlan{Family::multisine, 1.0, 0.5, {0.2, 0.7, 0.1}},
};

std::string size_in_words(double value, bool force) {
  return force ? physics::number_text(value, 3) + " N"
               : physics::number_text(1.0e3 * value, 3) + " mm";
}

}  // namespace

std::string_view name_of(Family family) {
  switch (family) {
    case Family::modulated:
      return "modulated";
    case Family::stepped:
      return "stepped";
    case Family::sweep:
      return "sweep";
    case Family::bursts:
      return "bursts";
    case Family::hold:
      return "hold";
    case Family::multisine:
      return "multisine";
  }
  return "";
}

Drive drive_of(const RunPlan& run, const RunRange& range) {
  const Numbers n = numbers_of(run, range);
  Drive out;
  const double length_s = rest_before_s + n.moving_s + rest_after_s;
  out.samples.resize(static_cast<std::size_t>(std::llround(length_s / out.period_s)));
  for (std::size_t k = 0; k < out.samples.size(); ++k) {
    const double time_s = out.period_s * static_cast<double>(k) - rest_before_s;
    const double ends = window(time_s, n.moving_s, taper_s);
    out.samples[k] = ends > 0.0 ? ends * unit_drive(run, n, time_s) : 0.0;
  }
  const double share = between_logs(smallest_amplitude, 1.0, run.amplitude);
  return scaled(out, reserve * share * factor_within(peaks_of(out), range.limits));
}

std::string words_for(const RunPlan& run, const RunRange& range, bool force) {
  using physics::number_text;
  const Numbers n = numbers_of(run, range);
  const auto hz = [](double value) { return number_text(value, 3) + " Hz"; };
  const auto s = [](double value) { return number_text(value, 3) + " s"; };
  std::string out;
  switch (run.family) {
    case Family::modulated:
      out = "a sine at " + hz(n.hz) + ", modulated by " +
            number_text(std::round(100.0 * n.depth), 3) + " % at " + hz(n.slow_hz);
      break;
    case Family::stepped:
      out = "a sine at " + hz(n.hz) + " in four steps of amplitude, from " +
            number_text(std::round(100.0 * std::max(1.0 - n.depth, smallest_amplitude)), 3) + " %";
      break;
    case Family::sweep:
      out = "a sweep from " + hz(n.hz) + " to " + hz(n.other_hz);
      break;
    case Family::bursts:
      out = "bursts of " + s(n.burst_s) + " at " + hz(n.hz) + " with rests of " + s(n.rest_s);
      break;
    case Family::hold:
      out =
          "a rest of " + s(n.rest_s) + " between two bursts of " + s(n.burst_s) + " at " + hz(n.hz);
      break;
    case Family::multisine:
      out = "five sines from " + hz(n.hz) + " to " + hz(n.other_hz);
      break;
  }
  const Drive drive = drive_of(run, range);
  return out + ", " + size_in_words(peaks_of(drive).value, force) + ", " + s(drive.duration_s());
}

std::span<const RunPlan> usual_runs() { return usual; }

}  // namespace stickslip::design
