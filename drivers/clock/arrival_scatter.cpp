// SPDX-License-Identifier: Apache-2.0
#include "drivers/clock/arrival_scatter.h"

#include <algorithm>
#include <cmath>

namespace stickslip::drivers {

namespace {
constexpr double period_weight = 0.05;
constexpr double variance_weight = 0.05;
}  // namespace

void ArrivalScatter::add(std::int64_t arrival_ns) {
  const auto interval_ns = static_cast<double>(arrival_ns - last_ns_);
  const bool first = last_ns_ < 0;
  last_ns_ = arrival_ns;
  if (first) return;
  const double periods = std::max(1.0, std::round(interval_ns / period_ns_));
  const double late_ns = interval_ns - periods * period_ns_;
  period_ns_ = std::clamp(period_ns_ + period_weight * late_ns / periods, 0.75 * nominal_ns_,
                          1.25 * nominal_ns_);
  ++intervals_;
  const double weight = std::max(variance_weight, 1.0 / intervals_);
  variance_ += weight * (0.5 * late_ns * late_ns - variance_);
}

std::int64_t ArrivalScatter::sigma_ns() const { return std::llround(std::sqrt(variance_)); }

}  // namespace stickslip::drivers
