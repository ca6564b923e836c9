// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/integrity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdio>
#include <numbers>

#include "diagnosis/channel_readings.h"
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

// A channel at the instants of the longest segment.
std::vector<double> longest_series(const std::vector<Frame>& frames, const TimeGrid& grid,
                                   Channel channel) {
  const auto longest = std::max_element(
      grid.segments.begin(), grid.segments.end(),
      [](const auto& a, const auto& b) { return a.end - a.begin < b.end - b.begin; });
  const ChannelReadings readings = readings_of(frames, grid, channel);
  const Range range{longest->begin, longest->end};
  const Series series = series_over(readings, grid, range);
  std::vector<double> out;
  for (std::size_t k = range.begin; k < range.end; ++k) {
    out.push_back(interpolated(series.value, series.position(k), 0, series.value.size()));
  }
  return out;
}

ChannelIntegrity channel_integrity(const std::vector<Frame>& frames, Channel channel) {
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
  return out;
}

// A line adds A^2 / 2 to the squares of the residuals: less than this share of the noise is not
// worth a search for its source.
constexpr double least_share_of_noise = 0.02;
// Harmonics of the drive that a rig may answer with.
constexpr double highest_harmonic = 9.0;

void set_mains(const std::vector<double>& values, double period_s, double drive_hz,
               std::optional<double> declared_noise, ChannelIntegrity& out) {
  const auto line = mains_of(values, period_s, true);
  if (!line) return;
  // Nothing is measured, and no model predicts, below a thousandth of the range.
  const double noise =
      std::max(declared_noise.value_or(noise_of(values)), 3.0e-4 * (out.highest - out.lowest));
  if (0.5 * line->amplitude * line->amplitude < least_share_of_noise * noise * noise) return;
  if (drive_hz > 0.0) {
    const double order = std::round(line->frequency_hz / drive_hz);
    const double resolution_hz = 1.0 / (period_s * static_cast<double>(values.size()));
    const bool of_drive = std::abs(line->frequency_hz - order * drive_hz) < order * resolution_hz;
    if (of_drive && order >= 1.0 && order <= highest_harmonic) return;
  }
  out.mains = line;
  out.mains_hz = mains_behind(line->frequency_hz, period_s);
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
  const auto x = longest_series(frames, grid, Channel::displacement);
  const auto v = longest_series(frames, grid, Channel::velocity);
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

// "displacement has 2 bad samples, which are not used: 100 m at 12.340 s, ..."
std::string outlier_remark(const ChannelIntegrity& c) {
  constexpr std::size_t most_listed = 4;
  const std::string unit(info(c.channel).unit);
  const std::size_t count = c.outliers.size();
  std::string out = std::string(info(c.channel).stem) + " has " +
                    physics::counted(count, "bad sample") +
                    (count == 1 ? ", which is not used:" : ", which are not used:");
  for (std::size_t i = 0; i < std::min(count, most_listed); ++i) {
    const Outlier& each = c.outliers[i];
    out += printed("%s %.3g ", i == 0 ? "" : ",", each.value) + unit +
           printed(" at %.3f s (%.3g ", each.time_s, each.expected) + unit + " around it)";
  }
  if (count > most_listed) out += printed(" and %zu more", count - most_listed);
  return out;
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
  if (!c.outliers.empty()) remarks.push_back(outlier_remark(c));
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
    const bool seen_elsewhere = std::abs(c.mains->frequency_hz - c.mains_hz) > 1.0;
    remarks.push_back(name + printed(" contains a mains line of %.3g ", c.mains->amplitude) + unit +
                      printed(" at %.2f Hz", c.mains->frequency_hz) +
                      (seen_elsewhere
                           ? printed(", the alias of %.0f Hz at this sampling rate", c.mains_hz)
                           : "") +
                      ": look for a ground loop");
  }
}

void set_timing(const protocol::Recording& recording, const TimeGrid& grid, Integrity& out) {
  const auto& frames = recording.frames;
  const auto after_left_out = [&recording](std::size_t i) {
    const auto& list = recording.after_left_out;
    return std::binary_search(list.begin(), list.end(), i);
  };
  out.frames = frames.size();
  out.rate_hz = 1.0 / grid.period_s;
  out.duration_s =
      static_cast<double>(frames.back().time_ns - frames.front().time_ns) * 1.0e-9 + grid.period_s;
  out.jitter = grid.jitter_s / grid.period_s;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    const double gap = static_cast<double>(frames[i].time_ns - frames[i - 1].time_ns) * 1.0e-9;
    const std::uint32_t instants = grid.instant[i] - grid.instant[i - 1];
    if (instants < 2 || after_left_out(i)) continue;
    out.longest_gap_s = std::max(out.longest_gap_s, gap);
    const double steps = gap > longest_hole_periods * grid.period_s
                             ? std::max(1.0, std::round(gap / grid.period_s))
                             : static_cast<double>(instants);
    out.lost += static_cast<std::size_t>(steps) - 1;
  }
}

void add_timing_remarks(const Criteria& criteria, Integrity& out) {
  if (out.lost > 0) {
    out.remarks.push_back(printed(
        "%zu of %s missing; the longest gap is %.3g s", out.lost,
        (physics::counted(out.frames + out.lost, "sample") + (out.lost == 1 ? " is" : " are"))
            .c_str(),
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

Integrity integrity_of(const protocol::Recording& as_recorded, const physics::Model& model,
                       const Criteria& criteria) {
  Integrity out;
  const Cleaned cleaned(as_recorded);
  const protocol::Recording& recording = cleaned.recording();
  out.source = recording.source;
  const auto& frames = recording.frames;
  const TimeGrid grid = time_grid_of(frames);
  set_timing(recording, grid, out);
  if (recording.left_out > 0) {
    out.remarks.push_back(
        physics::counted(recording.left_out, "frame") + " of " +
        std::to_string(recording.left_out + frames.size()) +
        " were left out, more than one diagnosis can take; those taken are stretches spread over "
        "the recording");
  }
  add_timing_remarks(criteria, out);
  const auto recorded = [&](Channel channel) {
    return ((recording.channels >> index_of(channel)) & 1U) != 0;
  };
  double drive_hz = 0.0;
  for (const Channel channel : {Channel::base_displacement, Channel::drive_force}) {
    if (!recorded(channel)) continue;
    drive_hz = strongest_frequency_hz(longest_series(frames, grid, channel), grid.period_s);
  }
  for (const Channel channel : all_channels) {
    if (!recorded(channel)) continue;
    out.channels.push_back(channel_integrity(frames, channel));
    set_mains(longest_series(frames, grid, channel), grid.period_s, drive_hz,
              model.sensors[index_of(channel)].noise_std, out.channels.back());
    for (const Outlier& each : cleaned.outliers()) {
      if (each.channel == channel) out.channels.back().outliers.push_back(each);
    }
    out.channels.back().missing -= out.channels.back().outliers.size();
    add_remarks(out.channels.back(), frames.size(), criteria, out.remarks);
  }
  if (recorded(Channel::displacement) && recorded(Channel::velocity)) {
    set_velocity_delay(frames, grid, model, out);
    add_delay_remark(grid, criteria, out);
  }
  return out;
}

}  // namespace stickslip::diagnosis
