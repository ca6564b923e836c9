#include "daemon/calibration.h"

#include <cmath>

namespace stickslip::daemon {

Calibrated calibrated(const Frame& raw, const Calibration& calibration) {
  Calibrated out;
  out.frame.time_ns = raw.time_ns;
  out.frame.sequence = raw.sequence;
  for (Channel channel : all_channels) {
    if (!raw.has(channel)) continue;
    const std::size_t i = index_of(channel);
    const double si = (raw.value[i] - calibration[i].offset) * calibration[i].gain;
    if (std::isfinite(si)) {
      out.frame.set(channel, si);
    } else {
      out.not_finite = static_cast<std::uint8_t>(out.not_finite | (1U << i));
    }
  }
  return out;
}

}  // namespace stickslip::daemon
