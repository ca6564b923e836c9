// SPDX-License-Identifier: Apache-2.0
#include "drivers/usb_1208fs_plus/numbering.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stickslip::drivers::usb_1208fs_plus {

namespace {
constexpr std::int64_t second_ns = 1'000'000'000;
constexpr double never = std::numeric_limits<double>::max();
}  // namespace

void Numbering::begin(std::int64_t host_ns) {
  if (started_) {
    const double passed_ns = static_cast<double>(host_ns - start_ns_) - drift_ns();
    first_exact_ += passed_ns / period_ns_;
    const double whole = std::max(0.0, std::round(first_exact_));
    next_ = std::max(next_ + 1, static_cast<std::uint64_t>(whole));
  }
  started_ = true;
  first_ = next_;
  start_ns_ = window_ns_ = host_ns;
  min_lateness_ns_ = never;
  initial_lateness_ns_.reset();
}

void Numbering::arrived(std::int64_t host_ns) {
  const double taken_ns = static_cast<double>(next_ - first_) * period_ns_;
  min_lateness_ns_ =
      std::min(min_lateness_ns_, static_cast<double>(host_ns - start_ns_) - taken_ns);
  if (host_ns - window_ns_ < second_ns) return;
  window_ns_ = host_ns;
  last_lateness_ns_ = min_lateness_ns_;
  if (!initial_lateness_ns_) initial_lateness_ns_ = min_lateness_ns_;
  min_lateness_ns_ = never;
}

double Numbering::drift_ns() const {
  return initial_lateness_ns_ ? last_lateness_ns_ - *initial_lateness_ns_ : 0.0;
}

}  // namespace stickslip::drivers::usb_1208fs_plus
