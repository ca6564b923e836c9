// SPDX-License-Identifier: Apache-2.0
// Wall clock for messages: follows the host's, but never runs backwards.
#pragma once

#include <cstdint>

namespace stickslip::daemon {

/// Advances with the monotonic clock. Follows a host clock that was set forward immediately, and
/// waits for one that was set back by running slow at 500 parts per million, so that messages
/// sorted by this time stay in order.
class UtcClock {
 public:
  /// From the current readings of both clocks; wall clock and result in us since 1970.
  std::int64_t utc_us(std::int64_t monotonic_ns, std::int64_t wall_us);

 private:
  bool started_ = false;
  std::int64_t monotonic_ns_ = 0;
  double utc_us_ = 0.0;
};

}  // namespace stickslip::daemon
