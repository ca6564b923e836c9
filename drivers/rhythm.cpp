#include "drivers/rhythm.h"

#include <algorithm>
#include <cmath>

namespace stickslip::drivers {

std::uint64_t Rhythm::take(std::int64_t time_ns, std::uint64_t messages) {
  const auto come = static_cast<double>(messages);
  const double passed = (static_cast<double>(time_ns) - last_ns_) / interval_ns_;
  const double due = std::max(come, std::floor(messages > 0 ? passed + 0.25 : passed - 0.75));
  last_ns_ = messages > 0 ? static_cast<double>(time_ns) : last_ns_ + due * interval_ns_;
  if (messages > 0) interval_ns_ *= 1.0 + 0.05 * (passed / due - 1.0);
  interval_ns_ = std::clamp(interval_ns_, 0.5 * usual_ns_, 2.0 * usual_ns_);
  return static_cast<std::uint64_t>(due - come);
}

}  // namespace stickslip::drivers
