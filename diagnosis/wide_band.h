// SPDX-License-Identifier: Apache-2.0
// Signal before the filters of a noisy channel: value, rate and acceleration without phase lag, by
// spectral subtraction and inverse filtering. Used for inputs (the base's acceleration) and for
// first guesses of states, never for the comparison with a model.
#pragma once

#include <span>
#include <vector>

#include "diagnosis/noise_floor.h"
#include "physics/sensor_chain.h"

namespace stickslip::diagnosis {

struct WideBand {
  std::vector<double> value;
  std::vector<double> rate;          ///< first derivative
  std::vector<double> acceleration;  ///< second derivative
  /// Standard deviations of the errors that are due to the noise of the samples.
  double rate_noise_std = 0.0;
  double acceleration_noise_std = 0.0;
  double highest_hz =
      0.0;  ///< of the frequencies that were kept: beyond it the errors have no power
};

/// Inverts `chain` on `samples` (period_s apart, at least 8 of them) at frequencies where the
/// signal exceeds the noise. The derivatives are less accurate within about a tenth of a second of
/// both ends. `lead_s`: further time by which the signal leads its reading.
WideBand wide_band(std::span<const double> samples, double period_s,
                   const physics::FilterChain& chain, const NoiseFloor& noise, double lead_s = 0.0);

/// With white noise of `noise_std` per sample.
WideBand wide_band(std::span<const double> samples, double period_s,
                   const physics::FilterChain& chain, double noise_std);

/// Standard deviation of the white noise in a channel whose signal is smooth over a few samples:
/// from the median of the sixth differences, which is robust to jumps; at least the quantisation
/// noise of the smallest step. 0 for a constant channel.
double noise_of(std::span<const double> samples);

}  // namespace stickslip::diagnosis
