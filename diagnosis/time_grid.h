// SPDX-License-Identifier: Apache-2.0
// Clock of a recording: a straight line through the times of its rows, and the uniform grid of
// instants on it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "physics/frame.h"

namespace stickslip::diagnosis {

/// Instants are numbered from 0. Missing frames leave empty instants; a long gap is cut out and
/// leaves one, so that its length costs nothing.
struct TimeGrid {
  /// Frames without a long gap between them. All segments have the same period and each has its own
  /// phase: a clock may have been set in a gap.
  struct Segment {
    std::size_t begin = 0;  ///< first instant
    std::size_t end = 0;    ///< after its last one
    double start_s = 0.0;   ///< of the first instant, after that of the grid
    std::size_t first_frame = 0;
  };
  double start_s = 0.0;  ///< time of instant 0
  double period_s = 0.0;
  std::vector<Segment> segments;
  std::vector<std::uint32_t> instant;  ///< by frame; frames of different channels may share one
  /// Time of each frame after its instant [s]. Empty where the times are on the line but for the
  /// rounding of their writer, which says less than the line.
  std::vector<float> after_s;
  double jitter_s = 0.0;  ///< largest magnitude in after_s

  std::size_t instants() const { return segments.back().end; }
};

/// Gaps longer than this are cut out [periods].
inline constexpr double longest_hole_periods = 16.0;

/// `frames`: at least two, in increasing time. The period is fitted, not rounded: with rows that
/// are missing, times rounded to milliseconds and jitter of a third of a period.
TimeGrid time_grid_of(std::span<const Frame> frames);

}  // namespace stickslip::diagnosis
