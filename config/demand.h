// SPDX-License-Identifier: Apache-2.0
// Demand of an excitation on the shaker, compared with its limits.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "config/rig.h"

namespace stickslip::config {

/// Bounds of |u|, |u'| and |u''| of a drive u in steady operation, without its ramps: in m, m/s and
/// m/s^2, or N, N/s and N/s^2.
struct Demand {
  double displacement = 0.0;
  double velocity = 0.0;
  double acceleration = 0.0;
};

/// Zero for the kind `file`, whose demand depends on its data. Exact for one sine, otherwise an
/// upper bound except at the corners of an envelope table.
Demand demand_of(const Excitation& excitation);

/// Lines of a multisine: those of the file, or those given by its numbers, scaled so that their sum
/// stays within excitation.amplitude.
std::vector<Line> lines_of(const Excitation& excitation);

/// Shortest duration of a movement of the hand [s]; the longest is three times as long.
double shortest_move_s(const ByHand& by_hand);

/// Highest frequency [Hz] without modulation; 0 for a file.
double highest_frequency_hz(const Excitation& excitation);

/// A limit that a demand exceeds by more than rounding.
struct Excess {
  const char* key = "";  ///< "limits.displacement_m", ...
  double limit = 0.0;
  double demand = 0.0;
  const char* unit = "";
};

/// The limit with the largest relative excess; empty if none is exceeded. `force`: of a
/// force-excited rig, which has no limit of the second derivative.
std::optional<Excess> excess_of(const Demand& demand, const Limits& limits, bool force);

/// "0.0123 m, limits.displacement_m allows 0.01".
std::string text_of(const Excess& excess);

/// Four significant digits.
std::string short_number(double value);

}  // namespace stickslip::config
