// From what a device says to what a channel measures.
#pragma once

#include <array>
#include <cstdint>

#include "config/rig.h"
#include "physics/frame.h"

namespace stickslip::daemon {

using Calibration = std::array<config::ChannelCalibration, channel_count>;

/// A frame in SI, and the channels that held a number which is none.
struct Calibrated {
  Frame frame;
  std::uint8_t not_finite = 0;  ///< bit i: channel i was NaN or infinite and is now invalid
};

/// SI = (raw - offset) * gain for every valid channel; time and sequence are kept. A channel that
/// was invalid stays so with value 0; one that is not finite, before or after, becomes invalid.
/// With offset 0 and gain 1 the value is the same to the bit.
Calibrated calibrated(const Frame& raw, const Calibration& calibration);

}  // namespace stickslip::daemon
