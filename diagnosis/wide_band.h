// What a filtered, noisy channel was before its filters: value, rate and acceleration, without
// phase lag, by a Wiener filter in the frequency domain. Used for inputs (the base's acceleration)
// and for first guesses of states; nothing is ever judged by it.
#pragma once

#include <span>
#include <vector>

#include "physics/sensor_chain.h"

namespace stickslip::diagnosis {

struct WideBand {
  std::vector<double> value;
  std::vector<double> rate;          ///< first derivative
  std::vector<double> acceleration;  ///< second derivative
  /// What the acceleration is wrong by, for the noise of the samples: its standard deviation.
  double acceleration_noise_std = 0.0;
};

/// Undoes `chain` on `samples` (period_s apart, at least 8 of them) where the signal stands above
/// white noise of `noise_std` at each sample. Near both ends, within about a tenth of a second, the
/// derivatives are less good: nothing is known beyond the ends.
WideBand wide_band(std::span<const double> samples, double period_s,
                   const physics::FilterChain& chain, double noise_std);

/// Standard deviation of the white noise in a channel that is otherwise smooth on the scale of a
/// few samples: from sixth differences, by their median so that jumps do not count; at least the
/// quantisation noise of the smallest step that occurs. 0 for a constant channel.
double noise_of(std::span<const double> samples);

}  // namespace stickslip::diagnosis
