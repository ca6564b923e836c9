// What an excitation asks of the shaker, and whether its limits grant it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "config/rig.h"

namespace stickslip::config {

/// Bounds of |u|, |u'| and |u''| of a drive u that runs steadily, without its ramps: in m, m/s and
/// m/s^2, or N, N/s and N/s^2.
struct Demand {
  double displacement = 0.0;
  double velocity = 0.0;
  double acceleration = 0.0;
};

/// Of any kind but `file`, which only its data can tell: zero. Exact for one sine, and never too
/// small but for the corners of an envelope table.
Demand demand_of(const Excitation& excitation);

/// The sines of a multisine: those of the file, or those that its numbers stand for, scaled so that
/// their sum stays within excitation.amplitude.
std::vector<Line> lines_of(const Excitation& excitation);

/// A movement of the hand takes at least this long [s]; at most three times as long.
double shortest_move_s(const ByHand& by_hand);

/// The highest frequency in it [Hz], modulation left out; 0 for a file.
double highest_frequency_hz(const Excitation& excitation);

/// Which limit a demand exceeds, by more than rounding.
struct Excess {
  const char* key = "";  ///< "limits.displacement_m", ...
  double limit = 0.0;
  double demand = 0.0;
  const char* unit = "";
};

/// The limit that is exceeded most, relative to itself; none where all are kept. `force`: of a
/// force-excited rig, which has no limit of its second derivative.
std::optional<Excess> excess_of(const Demand& demand, const Limits& limits, bool force);

/// "0.0123 m, limits.displacement_m allows 0.01".
std::string text_of(const Excess& excess);

/// Four digits, as a person writes them.
std::string short_number(double value);

}  // namespace stickslip::config
