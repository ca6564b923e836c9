// SPDX-License-Identifier: Apache-2.0
// Families of runs that a bench can make. Each run of a family is a point of the unit cube, so that
// an optimiser can move through all of them.
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>

#include "diagnosis/design/drive.h"

namespace stickslip::design {

enum class Family {
  modulated,  ///< a carrier whose amplitude goes up and down
  stepped,    ///< a carrier in four steps of amplitude
  sweep,      ///< a carrier of rising or falling frequency
  bursts,     ///< bursts of a carrier and rests between them: free decays, and starts from rest
  hold,       ///< one burst, a long rest, and another burst: what a contact gains at rest
  multisine,  ///< five sines at once
};
inline constexpr std::array all_families = {Family::modulated, Family::stepped, Family::sweep,
                                            Family::bursts,    Family::hold,    Family::multisine};

std::string_view name_of(Family family);

/// Numbers of a run: 0 to 1 each. Amplitude and duration mean the same in every family.
inline constexpr std::size_t run_numbers = 5;
struct RunPlan {
  Family family = Family::modulated;
  double amplitude = 1.0;  ///< share of the largest that the limits of the drive allow, logarithmic
  double duration = 0.5;   ///< between the shortest and the longest run
  std::array<double, 3> shape = {0.5, 0.5, 0.5};
};

/// Durations, frequencies and limits that the bench allows.
struct RunRange {
  double lowest_hz = 0.5;
  double highest_hz = 10.0;
  double shortest_s = 8.0;
  double longest_s = 20.0;
  DriveLimits limits;
};

/// Time at rest before and after the motion of every run [s].
inline constexpr double rest_before_s = 0.3;
inline constexpr double rest_after_s = 0.7;

/// The drive, within the limits. Amplitudes go from a fiftieth of the largest to all of it.
Drive drive_of(const RunPlan& run, const RunRange& range);

/// "bursts of 2.4 s at 3.1 Hz with rests of 1.8 s, 8.2 mm, 14 s"; `force`: amplitudes in newtons.
std::string words_for(const RunPlan& run, const RunRange& range, bool force);

/// Runs from which a search starts: what a person would try.
std::span<const RunPlan> usual_runs();

}  // namespace stickslip::design
