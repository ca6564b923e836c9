// SPDX-License-Identifier: Apache-2.0
// Measurements of one channel, each at its own time, and signals on a uniform grid made of them.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "diagnosis/time_grid.h"
#include "physics/frame.h"

namespace stickslip::diagnosis {

/// One measurement, the age of its channel and the jitter of its row taken into account.
struct Reading {
  double at = 0.0;  ///< time, in periods of the grid from its instant 0
  double value = 0.0;
};

struct ChannelReadings {
  std::vector<Reading> list;  ///< in the order of `at`
  double spacing = 1.0;       ///< typical distance [periods of the grid], a whole number

  bool empty() const { return list.empty(); }
};

/// A reading that a device repeats with a growing age is one reading.
ChannelReadings readings_of(std::span<const Frame> frames, const TimeGrid& grid, Channel channel);

/// Mean of the values; 0 without any.
double mean_of(const ChannelReadings& readings);
/// Standard deviation of the values; 0 without any.
double standard_deviation_of(const ChannelReadings& readings);

/// noise_of (wide_band.h) of what was measured: over seven successive readings at their own times,
/// never across a missing one.
double noise_of(const ChannelReadings& readings);

/// Standard deviation of the white noise in these readings if it is certainly above `declared`,
/// else `declared`. What every second reading shows beyond the noise of all is signal, half of
/// which all show.
double at_least_white_noise(const ChannelReadings& readings, double declared);

/// The most successive readings, up to eight, that interpolation restores to the accuracy of
/// readings with that noise: tried by leaving out as many where none is missing.
std::size_t most_restorable(const ChannelReadings& readings, double noise_std);

/// Instants from `begin` to before `end`.
struct Range {
  std::size_t begin = 0;
  std::size_t end = 0;
};

/// The ranges of instants in which no more than `missing` successive readings are missing, each
/// within one segment of the grid.
std::vector<Range> covered(const ChannelReadings& readings, const TimeGrid& grid,
                           std::size_t missing);

/// Instants that are in a range of both lists, which are in order.
std::vector<Range> common(std::span<const Range> one, std::span<const Range> other);

/// Values at equal distances.
struct Series {
  double first = 0.0;    ///< [periods of the grid]
  double spacing = 1.0;  ///< [periods of the grid]
  std::vector<double> value;

  /// Number in the series, and fraction, of an instant.
  double position(std::size_t instant) const {
    return (static_cast<double>(instant) - first) / spacing;
  }
};

/// A channel at its own spacing over a covered range: its readings where they are on the grid, else
/// interpolated from the six nearest.
Series series_over(const ChannelReadings& readings, const TimeGrid& grid, const Range& range);

/// Lagrange interpolation through the six nearest of the values at numbers `begin` to before `end`;
/// of lower order near these ends.
double interpolated(std::span<const double> values, double position, std::size_t begin,
                    std::size_t end);

}  // namespace stickslip::diagnosis
