// Uniform time grid of a recording, and its channels on it.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "physics/frame.h"

namespace stickslip::diagnosis {

struct TimeGrid {
  double start_s = 0.0;
  double period_s = 0.0;
  /// By grid instant: index of the nearest frame, or -1 where a frame is missing.
  std::vector<std::ptrdiff_t> frame;
};

/// `frames`: at least two, in increasing time.
TimeGrid time_grid_of(std::span<const Frame> frames);

/// One channel on the grid, interpolated linearly over missing frames.
std::vector<double> filled(std::span<const Frame> frames, const TimeGrid& grid, Channel channel);

}  // namespace stickslip::diagnosis
