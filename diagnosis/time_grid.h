// The uniform time grid of a recording, and its channels on it.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "physics/frame.h"

namespace stickslip::diagnosis {

struct TimeGrid {
  double start_s = 0.0;
  double period_s = 0.0;
  /// By instant of the grid: the index of the frame nearest to it, or -1 where there is none near.
  std::vector<std::ptrdiff_t> frame;
};

/// Of at least two frames in increasing time.
TimeGrid time_grid_of(std::span<const Frame> frames);

/// One channel on the grid, holes filled by straight lines.
std::vector<double> filled(std::span<const Frame> frames, const TimeGrid& grid, Channel channel);

}  // namespace stickslip::diagnosis
