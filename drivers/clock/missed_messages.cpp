// SPDX-License-Identifier: Apache-2.0
#include "drivers/clock/missed_messages.h"

#include <algorithm>
#include <cmath>

namespace stickslip::drivers {

std::uint64_t MissedMessages::count(std::int64_t time_ns, std::uint64_t messages) {
  const auto arrived = static_cast<double>(messages);
  const double elapsed = (static_cast<double>(time_ns) - last_ns_) / interval_ns_;
  const double due = std::max(arrived, std::floor(messages > 0 ? elapsed + 0.25 : elapsed - 0.75));
  last_ns_ = messages > 0 ? static_cast<double>(time_ns) : last_ns_ + due * interval_ns_;
  if (messages > 0) interval_ns_ *= 1.0 + 0.05 * (elapsed / due - 1.0);
  interval_ns_ = std::clamp(interval_ns_, 0.5 * nominal_ns_, 2.0 * nominal_ns_);
  return static_cast<std::uint64_t>(due - arrived);
}

}  // namespace stickslip::drivers
