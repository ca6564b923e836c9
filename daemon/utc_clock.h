// The wall clock as messages carry it: it follows the host's, but never runs backwards.
#pragma once

#include <cstdint>

namespace stickslip::daemon {

/// Between looks it runs with the monotonic clock. A host whose clock was set forward is followed
/// at once; one whose clock was set back is waited for, at half a per mille, so that whoever sorts
/// by this time sees what happened in its order.
class UtcClock {
 public:
  /// What the clocks say now [ns], [us since 1970]; the result in us since 1970.
  std::int64_t utc_us(std::int64_t monotonic_ns, std::int64_t wall_us);

 private:
  bool begun_ = false;
  std::int64_t monotonic_ns_ = 0;
  double utc_us_ = 0.0;
};

}  // namespace stickslip::daemon
