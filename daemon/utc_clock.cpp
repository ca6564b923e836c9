// SPDX-License-Identifier: Apache-2.0
#include "daemon/utc_clock.h"

#include <algorithm>

namespace stickslip::daemon {
namespace {

constexpr double largest_slew = 500e-6;
constexpr double longest_slewed_us = 1e6;

}  // namespace

std::int64_t UtcClock::utc_us(std::int64_t monotonic_ns, std::int64_t wall_us) {
  const auto wall = static_cast<double>(wall_us);
  if (!started_) {
    started_ = true;
    utc_us_ = wall;
  } else {
    const double passed = std::max(0.0, static_cast<double>(monotonic_ns - monotonic_ns_) * 1e-3);
    const double behind = wall - (utc_us_ + passed);
    const double slew = largest_slew * passed;
    utc_us_ += passed + (behind > longest_slewed_us ? behind : std::clamp(behind, -slew, slew));
  }
  monotonic_ns_ = std::max(monotonic_ns_, monotonic_ns);
  return static_cast<std::int64_t>(utc_us_);
}

}  // namespace stickslip::daemon
