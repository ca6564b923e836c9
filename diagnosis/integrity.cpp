#include "diagnosis/integrity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdio>
#include <numbers>

#include "diagnosis/spectrum.h"
#include "diagnosis/time_grid.h"
#include "diagnosis/wide_band.h"
#include "physics/number_text.h"
#include "physics/sensor_chain.h"

namespace stickslip::diagnosis {

namespace {

using std::numbers::pi;
using Complex = std::complex<double>;

// Quantisation step: all readings are the lowest one plus multiples of it.
double step_of(const std::vector<double>& readings) {
  std::vector<double> sorted = readings;
  std::sort(sorted.begin(), sorted.end());
  const double range = sorted.back() - sorted.front();
  if (!(range > 0.0)) return 0.0;
  double step = range;
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    const double d = sorted[i] - sorted[i - 1];
    if (d > 1.0e-9 * range) step = std::min(step, d);
  }
  // Beyond 24 bits the noise hides any step.
  if (range / step > 1.6e7) return 0.0;
  const std::size_t every = std::max<std::size_t>(1, sorted.size() / 2000);
  for (std::size_t i = 0; i < sorted.size(); i += every) {
    const double multiple = (sorted[i] - sorted.front()) / step;
    if (std::abs(multiple - std::round(multiple)) > 0.05) return 0.0;
  }
  return step;
}

// Number of readings clipped at `rail`. A rail holds many more readings than a band of the same
// width just inside it; the crest of a coarsely resolved channel does not.
std::size_t clipped_at(const std::vector<double>& readings, double rail, double tolerance,
                       double width) {
  constexpr std::size_t shortest = 3;
  std::size_t count = 0;
  std::size_t run = 0;
  for (std::size_t k = 0; k <= readings.size(); ++k) {
    if (k < readings.size() && std::abs(readings[k] - rail) <= tolerance) {
      ++run;
      continue;
    }
    if (run >= shortest) count += run;
    run = 0;
  }
  const auto inside = std::count_if(readings.begin(), readings.end(), [&](double reading) {
    const double away = std::abs(reading - rail);
    return away > tolerance && away <= width + tolerance;
  });
  return count > 4 * static_cast<std::size_t>(inside) ? count : 0;
}

ChannelIntegrity channel_integrity(const std::vector<Frame>& frames, const TimeGrid& grid,
                                   Channel channel) {
  ChannelIntegrity out;
  out.channel = channel;
  std::vector<double> readings;
  for (const Frame& frame : frames) {
    if (frame.has(channel)) {
      readings.push_back(frame[channel]);
    } else {
      ++out.missing;
    }
  }
  const auto [low, high] = std::minmax_element(readings.begin(), readings.end());
  out.lowest = *low;
  out.highest = *high;
  out.step = step_of(readings);
  const double range = out.highest - out.lowest;
  if (range > 0.0) {
    const double same = std::max(0.25 * out.step, 1.0e-9 * range);
    const double width = std::max(out.step, 1.0e-3 * range);
    out.at_low_rail = clipped_at(readings, out.lowest, same, width);
    out.at_high_rail = clipped_at(readings, out.highest, same, width);
  }
  out.mains = mains_of(filled(frames, grid, channel), grid.period_s);
  return out;
}

// Delay of `late` behind `early`, signals of one shape, from the slope of the phase between their
// spectra, and its standard error.
std::pair<double, double> delay_between(const std::vector<Complex>& early,
                                        const std::vector<Complex>& late, double step_hz) {
  double most = 0.0;
  for (const Complex& each : early) most = std::max(most, std::norm(each));
  double product = 0.0;
  double weight = 0.0;
  std::vector<std::pair<double, double>> used;  // quadrature and leverage of each line
  for (std::size_t i = 1; i < early.size(); ++i) {
    const double size = std::abs(early[i]);
    if (size * size < 1.0e-4 * most) continue;
    const double omega = 2.0 * pi * step_hz * static_cast<double>(i);
    const Complex turned = std::conj(early[i]) / size * late[i];
    const double leverage = omega * size;
    product -= leverage * turned.imag();
    weight += leverage * leverage;
    used.emplace_back(turned.imag(), leverage);
  }
  if (used.size() < 3) return {0.0, 1.0};
  const double delay = product / weight;
  double square = 0.0;
  for (const auto& [quadrature, leverage] : used) {
    square += std::pow(quadrature + delay * leverage, 2);
  }
  return {delay, std::sqrt(square / static_cast<double>(used.size() - 1) / weight)};
}

void set_velocity_delay(const std::vector<Frame>& frames, const TimeGrid& grid,
                        const physics::Model& model, Integrity& out) {
  const auto x = filled(frames, grid, Channel::displacement);
  const auto v = filled(frames, grid, Channel::velocity);
  // The displacement's own filters precede the differentiator too: they cancel.
  const WideBand motion = wide_band(x, grid.period_s, {}, noise_of(x));
  auto expected = windowed_spectrum(motion.rate);
  const double step_hz = 0.5 / (grid.period_s * static_cast<double>(expected.size()));
  const physics::FilterChain chain(model.sensors[index_of(Channel::velocity)].filters,
                                   grid.period_s);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    expected[i] *= chain.response(step_hz * static_cast<double>(i));
  }
  const auto [delay, error] = delay_between(expected, windowed_spectrum(v), step_hz);
  out.velocity_delay_s = delay;
  out.velocity_delay_error_s = error;
}

std::string printed(const char* format, auto... values) {
  char text[256];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

void add_remarks(const ChannelIntegrity& c, std::size_t frames, const Criteria& criteria,
                 std::vector<std::string>& remarks) {
  const std::string name(info(c.channel).stem);
  const std::string unit(info(c.channel).unit);
  const auto share = [&](std::size_t count) {
    return 100.0 * static_cast<double>(count) / static_cast<double>(frames);
  };
  if (c.missing > 0) {
    remarks.push_back(name + printed(" is missing in %zu of %s", c.missing,
                                     physics::counted(frames, "frame").c_str()));
  }
  if (!(c.highest > c.lowest)) {
    remarks.push_back(name + " never changes: is it connected?");
    return;
  }
  const std::size_t at_rails = c.at_low_rail + c.at_high_rail;
  if (share(at_rails) > criteria.remark_clipped_percent) {
    remarks.push_back(name + printed(" rests at its lowest (%.3g ", c.lowest) + unit +
                      printed(") or highest value (%.3g ", c.highest) + unit +
                      printed(") for %.2g %% of the time: it may be clipped", share(at_rails)));
  }
  const double steps = c.step > 0.0 ? (c.highest - c.lowest) / c.step : 0.0;
  if (steps > 0.0 && steps < criteria.remark_steps) {
    remarks.push_back(
        name + " spans only " + physics::counted(std::lround(steps), "quantisation step") +
        printed(" (%.3g ", c.step) + unit + " each): a smaller measuring range would resolve more");
  }
  if (c.mains) {
    remarks.push_back(name + printed(" contains a mains line of %.3g ", c.mains->amplitude) + unit +
                      printed(" at %.2f Hz: look for a ground loop", c.mains->frequency_hz));
  }
}

void set_timing(const std::vector<Frame>& frames, const TimeGrid& grid, Integrity& out) {
  out.frames = frames.size();
  out.rate_hz = 1.0 / grid.period_s;
  out.duration_s =
      static_cast<double>(frames.back().time_ns - frames.front().time_ns) * 1.0e-9 + grid.period_s;
  for (std::size_t k = 0; k < grid.frame.size(); ++k) {
    if (grid.frame[k] < 0) {
      ++out.lost;
      continue;
    }
    const Frame& frame = frames[static_cast<std::size_t>(grid.frame[k])];
    const double at =
        static_cast<double>(frame.time_ns - frames.front().time_ns) * 1.0e-9 / grid.period_s;
    out.jitter = std::max(out.jitter, std::abs(at - static_cast<double>(k)));
  }
  for (std::size_t i = 1; i < frames.size(); ++i) {
    const double gap = static_cast<double>(frames[i].time_ns - frames[i - 1].time_ns) * 1.0e-9;
    if (gap > 1.5 * grid.period_s) out.longest_gap_s = std::max(out.longest_gap_s, gap);
  }
}

void add_timing_remarks(const TimeGrid& grid, const Criteria& criteria, Integrity& out) {
  if (out.lost > 0) {
    out.remarks.push_back(printed(
        "%zu of %s missing; the longest gap is %.3g s", out.lost,
        (physics::counted(grid.frame.size(), "sample") + (out.lost == 1 ? " is" : " are")).c_str(),
        out.longest_gap_s));
  }
  if (out.jitter > criteria.remark_jitter) {
    out.remarks.push_back(printed(
        "sample times deviate by up to %.2g sampling periods from a uniform grid", out.jitter));
  }
}

void add_delay_remark(const TimeGrid& grid, const Criteria& criteria, Integrity& out) {
  const double size = std::abs(*out.velocity_delay_s);
  if (size > criteria.remark_delay_errors * out.velocity_delay_error_s &&
      size > criteria.remark_delay_periods * grid.period_s) {
    out.remarks.push_back(printed("velocity %s the derivative of the displacement by %.3g ms",
                                  *out.velocity_delay_s > 0.0 ? "lags" : "leads", 1e3 * size));
  }
}

}  // namespace

Integrity integrity_of(const protocol::Recording& recording, const physics::Model& model,
                       const Criteria& criteria) {
  Integrity out;
  out.source = recording.source;
  const auto& frames = recording.frames;
  const TimeGrid grid = time_grid_of(frames);
  set_timing(frames, grid, out);
  add_timing_remarks(grid, criteria, out);
  const auto recorded = [&](Channel channel) {
    return ((recording.channels >> index_of(channel)) & 1U) != 0;
  };
  for (const Channel channel : all_channels) {
    if (!recorded(channel)) continue;
    out.channels.push_back(channel_integrity(frames, grid, channel));
    add_remarks(out.channels.back(), frames.size(), criteria, out.remarks);
  }
  if (recorded(Channel::displacement) && recorded(Channel::velocity)) {
    set_velocity_delay(frames, grid, model, out);
    add_delay_remark(grid, criteria, out);
  }
  return out;
}

}  // namespace stickslip::diagnosis
