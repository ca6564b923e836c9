// SPDX-License-Identifier: Apache-2.0
#include "drivers/clock/device_clock.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace stickslip::drivers {
namespace {

/// Minimum weight of a new window's skew, which is one over the number of windows.
constexpr double min_weight = 1.0 / 16.0;
/// Number of windows over which a remaining offset is corrected.
constexpr double correction_windows = 4.0;
/// Before that the skew is hardly known, so an offset is corrected immediately.
constexpr std::uint64_t windows_to_settle = 4;

}  // namespace

void DeviceClock::begin(std::int64_t device_ns, std::int64_t offset_ns) {
  offset_ns_ = static_cast<double>(offset_ns);
  correction_ = 0.0;
  window_start_ns_ = device_ns;
  smallest_ns_ = offset_ns;
  smallest_at_ns_ = device_ns;
  previous_smallest_ns_.reset();
  settled_ = false;
}

void DeviceClock::close_window(std::int64_t device_ns) {
  if (previous_smallest_ns_ && smallest_at_ns_ > previous_at_ns_) {
    const double observed = static_cast<double>(smallest_ns_ - *previous_smallest_ns_) /
                            static_cast<double>(smallest_at_ns_ - previous_at_ns_);
    ++windows_;
    const double weight = std::max(min_weight, 1.0 / static_cast<double>(windows_));
    skew_ += weight * (std::clamp(observed, -largest_skew, largest_skew) - skew_);
  }
  const double offset_at_smallest =
      offset_ns_ - skew_ * static_cast<double>(device_ns - smallest_at_ns_);
  const double behind = static_cast<double>(smallest_ns_) - offset_at_smallest;
  // Not of the first window, whose offset was none yet.
  if (previous_smallest_ns_) {
    variance_ +=
        std::max(min_weight, 1.0 / static_cast<double>(std::max<std::uint64_t>(windows_, 1))) *
        (behind * behind - variance_);
  }
  if (settled_) {
    correction_ = std::clamp(behind / (correction_windows * static_cast<double>(window_ns)),
                             -largest_skew, largest_skew);
  } else {
    offset_ns_ += behind;
    correction_ = 0.0;
  }
  settled_ = windows_ >= windows_to_settle;
  previous_smallest_ns_ = smallest_ns_;
  previous_at_ns_ = smallest_at_ns_;
  window_start_ns_ = device_ns;
}

std::int64_t DeviceClock::host_time(std::int64_t device_ns, std::int64_t host_ns) {
  const std::int64_t difference_ns = host_ns - device_ns;
  if (!last_device_ns_) {
    begin(device_ns, difference_ns);
    last_out_ns_ = host_ns - 1;
  } else {
    const std::int64_t step_ns = device_ns - *last_device_ns_;
    offset_ns_ += (skew_ + correction_) * static_cast<double>(step_ns);
    const double apart = static_cast<double>(difference_ns) - offset_ns_;
    // Late readings are no discrepancy: only a step of the device's clock, or its lead, is.
    const bool stepped = step_ns <= 0 || step_ns > window_ns;
    if (apart < -static_cast<double>(restart_threshold_ns) ||
        (stepped && std::abs(apart) > static_cast<double>(restart_threshold_ns))) {
      ++restarts_;
      begin(device_ns, difference_ns);
    } else if (!previous_smallest_ns_ && apart < 0.0) {
      // In the first window only the smallest difference so far is available.
      offset_ns_ = static_cast<double>(difference_ns);
    }
    if (window_start_ns_ == device_ns || difference_ns <= smallest_ns_) {
      smallest_ns_ = difference_ns;
      smallest_at_ns_ = device_ns;
    }
    if (device_ns - window_start_ns_ >= window_ns) {
      close_window(device_ns);
      smallest_ns_ = difference_ns;
      smallest_at_ns_ = device_ns;
    }
  }
  last_device_ns_ = device_ns;
  const std::int64_t out_ns = device_ns + std::llround(offset_ns_);
  last_out_ns_ = std::max(last_out_ns_ + 1, out_ns);
  return last_out_ns_;
}

std::int64_t DeviceClock::sigma_ns() const { return std::llround(std::sqrt(variance_)); }

}  // namespace stickslip::drivers
