// SPDX-License-Identifier: Apache-2.0
// Limits for the difference between an output and what a spare input reads back of it.
#pragma once

#include "config/bench.h"

namespace stickslip::config {

struct ReadbackLimits {
  double delay_s = 0.0;      ///< longest time from a command to its reading
  double tolerance_v = 0.0;  ///< of a reading; 0 for the enable contact
};

/// Of a bench whose [readback.drive] is present, at a rate of the loop [Hz]. Unless it declares
/// them: the delay is the longest overrun of the loop, two packets of the board, and either the
/// time after which an unconfirmed set-point is repeated, or, of a paced output, what is queued
/// ahead and the time until one that ran dry is noticed; the tolerance is 1 % of the output's
/// range, two of its steps, and 0.1 % of the input's range.
ReadbackLimits drive_readback_limits(const Bench& bench, double rate_hz);

/// Likewise for [readback.enable], with the time that a contact needs: 0.05 s, and 0.3 s for the
/// thread that sets a line of a GPIO chip.
ReadbackLimits enable_readback_limits(const Bench& bench, double rate_hz);

}  // namespace stickslip::config
