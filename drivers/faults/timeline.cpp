// SPDX-License-Identifier: Apache-2.0
#include "drivers/faults/timeline.h"

#include <algorithm>
#include <cmath>

namespace stickslip::drivers {

namespace {

std::int64_t ns(double time_s) { return std::llround(time_s * 1.0e9); }

/// At least one nanosecond.
std::int64_t length_ns(const std::optional<double>& time_s) {
  return time_s ? std::max<std::int64_t>(1, ns(*time_s)) : 0;
}

}  // namespace

Timeline::Timeline(const config::Fault& fault, Chance chance)
    : chance_(chance),
      from_ns_(ns(fault.from_s)),
      width_ns_(ns(fault.to_s) - from_ns_),
      duration_ns_(length_ns(fault.duration_s)),
      every_ns_(length_ns(fault.every_s)) {}

std::optional<Occurrence> Timeline::at(std::int64_t time_ns) const {
  if (time_ns < from_ns_) return std::nullopt;
  Occurrence out;
  if (every_ns_ > 0) out.number = static_cast<std::uint64_t>((time_ns - from_ns_) / every_ns_);
  out.begin_ns = from_ns_ + static_cast<std::int64_t>(out.number) * every_ns_;
  if (width_ns_ > 0) {
    const double part = chance_.uniform(Purpose::moment, out.number);
    out.begin_ns += std::llround(part * static_cast<double>(width_ns_));
  }
  if (duration_ns_ > 0) out.end_ns = out.begin_ns + duration_ns_;
  if (time_ns < out.begin_ns || time_ns >= out.end_ns) return std::nullopt;
  return out;
}

}  // namespace stickslip::drivers
