// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/channel_readings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "diagnosis/median.h"
#include "diagnosis/wide_band.h"

namespace stickslip::diagnosis {

namespace {

// Distances below this are equal [periods]: times are known to a nanosecond.
constexpr double same_time = 1.0e-5;
// Readings that may be missing in succession and be restored.
constexpr std::size_t most_missing = 8;

double spacing_of(const std::vector<Reading>& list) {
  if (list.size() < 2) return 1.0;
  std::vector<double> distances;
  distances.reserve(list.size() - 1);
  for (std::size_t i = 1; i < list.size(); ++i) distances.push_back(list[i].at - list[i - 1].at);
  return std::max(1.0, std::round(median(std::move(distances))));
}

bool is_regular(const ChannelReadings& readings) {
  for (std::size_t i = 1; i < readings.list.size(); ++i) {
    const double distance = readings.list[i].at - readings.list[i - 1].at;
    if (std::abs(distance - readings.spacing) > same_time) return false;
  }
  return true;
}

struct Interpolated {
  double value = 0.0;
  double noise = 0.0;  // variance, in units of that of a node
};

// Value at `at` of the polynomial through the nodes.
Interpolated lagrange(std::span<const Reading> nodes, double at) {
  Interpolated out;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    double weight = 1.0;
    for (std::size_t j = 0; j < nodes.size(); ++j) {
      if (j != i) weight *= (at - nodes[j].at) / (nodes[i].at - nodes[j].at);
    }
    out.value += weight * nodes[i].value;
    out.noise += weight * weight;
  }
  return out;
}

// Value at `at`, before the reading number `next`: from the six nearest, or on a line across what
// these would not restore.
double between(std::span<const Reading> list, std::size_t next, double at, double spacing) {
  if (list.empty()) return 0.0;
  const Reading& after = list[std::min(next, list.size() - 1)];
  const Reading& before = list[next > 0 ? next - 1 : 0];
  const double distance = std::max(after.at, at) - std::min(before.at, at);
  if (distance > (static_cast<double>(most_missing) + 1.6) * spacing) {
    if (!(after.at > before.at)) return after.value;
    const double share = std::clamp((at - before.at) / (after.at - before.at), 0.0, 1.0);
    return before.value + share * (after.value - before.value);
  }
  const std::size_t begin = next > 3 ? next - 3 : 0;
  const std::size_t end = std::min(list.size(), next + 3);
  return lagrange(list.subspan(begin, end - begin), at).value;
}

// Readings of one segment of the grid.
std::span<const Reading> within(const ChannelReadings& readings, double begin, double end) {
  const auto before = [](const Reading& reading, double at) { return reading.at < at; };
  const auto& list = readings.list;
  const auto from = std::lower_bound(list.begin(), list.end(), begin, before);
  const auto to = std::lower_bound(from, list.end(), end, before);
  return {from, to};
}

const TimeGrid::Segment& segment_at(const TimeGrid& grid, double at) {
  auto next = std::upper_bound(grid.segments.begin(), grid.segments.end(), at + 0.5,
                               [](double instant, const TimeGrid::Segment& segment) {
                                 return instant < static_cast<double>(segment.begin);
                               });
  return next == grid.segments.begin() ? *next : *--next;
}

std::span<const Reading> in_segment(const ChannelReadings& readings,
                                    const TimeGrid::Segment& segment) {
  return within(readings, static_cast<double>(segment.begin) - 0.5,
                static_cast<double>(segment.end) - 0.5);
}

// Sixth differences of readings at any times, in units of the standard deviation that white noise
// of 1 gives them.
void add_differences(std::span<const Reading> seven, std::vector<double>& differences) {
  double sum = 0.0;
  double square = 0.0;
  for (const Reading& each : seven) {
    double weight = 1.0;
    for (const Reading& other : seven) {
      if (&other != &each) weight /= each.at - other.at;
    }
    sum += weight * each.value;
    square += weight * weight;
  }
  differences.push_back(std::abs(sum) / std::sqrt(square));
}

}  // namespace

ChannelReadings readings_of(std::span<const Frame> frames, const TimeGrid& grid, Channel channel) {
  const std::size_t c = index_of(channel);
  ChannelReadings out;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!frames[i].has(channel)) continue;
    double at = static_cast<double>(grid.instant[i]);
    if (!grid.after_s.empty()) at += static_cast<double>(grid.after_s[i]) / grid.period_s;
    at -= 1.0e-6 * static_cast<double>(frames[i].age_us[c]) / grid.period_s;
    // Ages are whole microseconds, and so is the time of a repeated reading.
    const double least = std::max(same_time, 1.5e-6 / grid.period_s);
    if (!out.list.empty() && at < out.list.back().at + least) continue;
    out.list.push_back({at, frames[i][channel]});
  }
  out.spacing = spacing_of(out.list);
  // Readings much closer than usual add nothing, and no polynomial can pass through them.
  std::erase_if(out.list, [&, last = -std::numeric_limits<double>::infinity()](
                              const Reading& reading) mutable {
    if (reading.at < last + 0.25 * out.spacing) return true;
    last = reading.at;
    return false;
  });
  return out;
}

double mean_of(const ChannelReadings& readings) {
  double sum = 0.0;
  for (const Reading& each : readings.list) sum += each.value;
  return readings.empty() ? 0.0 : sum / static_cast<double>(readings.list.size());
}

double standard_deviation_of(const ChannelReadings& readings) {
  if (readings.empty()) return 0.0;
  const double mean = mean_of(readings);
  double sum = 0.0;
  for (const Reading& each : readings.list) sum += (each.value - mean) * (each.value - mean);
  return std::sqrt(sum / static_cast<double>(readings.list.size()));
}

double noise_of(const ChannelReadings& readings) {
  const std::span<const Reading> list = readings.list;
  std::vector<double> values;
  values.reserve(list.size());
  for (const Reading& each : list) values.push_back(each.value);
  if (is_regular(readings) || list.size() < 16) return noise_of(values);
  std::vector<double> differences;
  constexpr std::size_t order = 7;
  double smallest_step = std::numeric_limits<double>::infinity();
  std::size_t first = 0;  // since the last missing reading
  for (std::size_t i = 1; i < list.size(); ++i) {
    if (list[i].at - list[i - 1].at > 1.75 * readings.spacing) first = i;
    if (i + 1 - first >= order) {
      add_differences(list.subspan(i + 1 - order, order), differences);
    }
    const double step = std::abs(list[i].value - list[i - 1].value);
    if (step > 0.0) smallest_step = std::min(smallest_step, step);
  }
  if (differences.empty()) return noise_of(values);
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  // A step near the resolution of doubles at this range is rounding, not quantisation.
  const double quantisation =
      std::isfinite(smallest_step) && smallest_step > 1.0e-12 * (*high - *low)
          ? smallest_step / std::sqrt(12.0)
          : 0.0;
  return std::max(median(std::move(differences)) / 0.6745, quantisation);
}

double at_least_white_noise(const ChannelReadings& readings, double declared) {
  constexpr double certain = 1.15;  // beyond the error of an estimate from a thousand readings
  const double found = noise_of(readings);
  if (found < certain * declared) return declared;
  ChannelReadings sparse;
  sparse.spacing = 2.0 * readings.spacing;
  for (std::size_t i = 0; i < readings.list.size(); i += 2) {
    sparse.list.push_back(readings.list[i]);
  }
  const double white = found - std::max(0.0, noise_of(sparse) - found);
  return white > certain * declared ? white : declared;
}

std::size_t most_restorable(const ChannelReadings& readings, double noise_std) {
  constexpr std::size_t places = 2000;
  const std::span<const Reading> list = readings.list;
  for (std::size_t missing = 1; missing <= most_missing; ++missing) {
    const std::size_t span = missing + 6;
    if (list.size() < 4 * span) return missing - 1;
    std::vector<double> off;
    const std::size_t stride = 1 + (list.size() - span) / places;
    for (std::size_t i = 0; i + span <= list.size(); i += stride) {
      const auto& last = list[i + span - 1];
      if (last.at - list[i].at > (static_cast<double>(span) - 0.25) * readings.spacing) continue;
      std::array<Reading, 6> nodes;
      std::copy_n(list.begin() + static_cast<std::ptrdiff_t>(i), 3, nodes.begin());
      std::copy_n(list.begin() + static_cast<std::ptrdiff_t>(i + 3 + missing), 3,
                  nodes.begin() + 3);
      const Reading& left_out = list[i + 3 + missing / 2];
      const Interpolated found = lagrange(nodes, left_out.at);
      off.push_back(std::abs(found.value - left_out.value) / std::sqrt(1.0 + found.noise));
    }
    if (off.size() < 16) return missing - 1;
    const auto rank = static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(off.size()));
    std::nth_element(off.begin(), off.begin() + rank, off.end());
    // Of noise alone 95 % are within two standard deviations.
    if (off[static_cast<std::size_t>(rank)] > 3.0 * noise_std) return missing - 1;
  }
  return most_missing;
}

std::vector<Range> covered(const ChannelReadings& readings, const TimeGrid& grid,
                           std::size_t missing) {
  const double longest = (static_cast<double>(missing) + 1.6) * readings.spacing;
  std::vector<Range> out;
  for (const TimeGrid::Segment& segment : grid.segments) {
    const auto list = in_segment(readings, segment);
    const auto close = [&](std::size_t from, std::size_t to) {
      const double begin = std::max(static_cast<double>(segment.begin), list[from].at - same_time);
      const double end = std::min(static_cast<double>(segment.end - 1), list[to].at + same_time);
      const Range range{static_cast<std::size_t>(std::ceil(begin)),
                        static_cast<std::size_t>(std::floor(end)) + 1};
      if (range.begin < range.end) out.push_back(range);
    };
    std::size_t from = 0;
    for (std::size_t i = 1; i < list.size(); ++i) {
      if (list[i].at - list[i - 1].at <= longest) continue;
      close(from, i - 1);
      from = i;
    }
    if (!list.empty()) close(from, list.size() - 1);
  }
  return out;
}

std::vector<Range> common(std::span<const Range> one, std::span<const Range> other) {
  std::vector<Range> out;
  std::size_t j = 0;
  for (std::size_t i = 0; i < one.size(); ++i) {
    while (j < other.size() && other[j].end <= one[i].begin) ++j;
    for (std::size_t k = j; k < other.size() && other[k].begin < one[i].end; ++k) {
      out.push_back({std::max(one[i].begin, other[k].begin), std::min(one[i].end, other[k].end)});
    }
  }
  return out;
}

Series series_over(const ChannelReadings& readings, const TimeGrid& grid, const Range& range) {
  const auto list = in_segment(readings, segment_at(grid, static_cast<double>(range.begin)));
  Series out;
  out.spacing = readings.spacing;
  out.first = static_cast<double>(range.begin);
  std::size_t next = 0;  // first reading that is not before the value
  const auto advance = [&](double at) {
    while (next < list.size() && list[next].at < at - same_time) ++next;
  };
  advance(out.first);
  // A slow channel starts with its last reading before the range.
  if (out.spacing > 1.0 && next > 0 &&
      !(next < list.size() && list[next].at < out.first + same_time)) {
    out.first = list[--next].at;
  }
  const double last = static_cast<double>(range.end - 1);
  const auto count =
      static_cast<std::size_t>(std::ceil((last - out.first) / out.spacing - same_time)) + 1;
  out.value.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double at = out.first + out.spacing * static_cast<double>(i);
    advance(at);
    if (next < list.size() && std::abs(list[next].at - at) <= same_time) {
      out.value.push_back(list[next].value);
      continue;
    }
    out.value.push_back(between(list, next, at, out.spacing));
  }
  return out;
}

double interpolated(std::span<const double> values, double position, std::size_t begin,
                    std::size_t end) {
  const double nearest = std::round(position);
  if (std::abs(position - nearest) <= same_time && nearest >= static_cast<double>(begin) &&
      nearest < static_cast<double>(end)) {
    return values[static_cast<std::size_t>(nearest)];
  }
  const auto k = static_cast<std::ptrdiff_t>(std::floor(position));
  const auto low = static_cast<std::ptrdiff_t>(begin);
  const auto high = static_cast<std::ptrdiff_t>(end) - 1;
  const std::ptrdiff_t first = std::clamp(k - 2, low, high);
  const std::ptrdiff_t last = std::clamp(k + 3, low, high);
  double sum = 0.0;
  for (std::ptrdiff_t i = first; i <= last; ++i) {
    double weight = 1.0;
    for (std::ptrdiff_t j = first; j <= last; ++j) {
      if (j != i) weight *= (position - static_cast<double>(j)) / static_cast<double>(i - j);
    }
    sum += weight * values[static_cast<std::size_t>(i)];
  }
  return sum;
}

}  // namespace stickslip::diagnosis
