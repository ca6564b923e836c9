// SPDX-License-Identifier: Apache-2.0
// Delay of a channel against another that follows the same motion.
#pragma once

#include <optional>
#include <vector>

namespace stickslip::commissioning {

/// Readings of a channel at their own times, which increase.
struct TimedReadings {
  std::vector<double> time_s;
  std::vector<double> value;
};

/// The channel follows the reference itself, or its rate of change.
enum class Follows { value, rate };

struct Delay {
  double delay_s = 0.0;    ///< positive: the channel is late
  double sigma_s = 0.0;    ///< of the residuals, with their correlation; without that of the times
  double explained = 0.0;  ///< share of the channel's variance, 0 to 1
};

/// The delay within +-`longest_s` at which a + b reference(t - delay) comes closest to the channel.
/// None where there are too few readings, or nothing moves.
std::optional<Delay> delay_of(const TimedReadings& channel, const TimedReadings& reference,
                              Follows follows, double longest_s);

}  // namespace stickslip::commissioning
