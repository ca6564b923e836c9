// SPDX-License-Identifier: Apache-2.0
// Mapping of a device's own clock to the host's monotonic clock.
#pragma once

#include <cstdint>
#include <optional>

namespace stickslip::drivers {

/// A reading can arrive late, never early: the minimum difference between host and device time
/// within a window is the best estimate of their offset. Between windows it changes with the skew
/// of the clocks, which is estimated and clamped; the remaining error is corrected gradually. The
/// result increases strictly, even if the clock of the device or of the host steps back. Does not
/// allocate.
class DeviceClock {
 public:
  /// Crystals are accurate to some 50 parts in a million; a larger skew has another cause.
  static constexpr double largest_skew = 500e-6;
  /// A larger discrepancy (the device restarted, the host was suspended) restarts the estimate.
  static constexpr std::int64_t restart_threshold_ns = 50'000'000;
  static constexpr std::int64_t window_ns = 1'000'000'000;

  /// Host time [ns] of a sample taken at `device_ns` and read at `host_ns`. Increases strictly from
  /// call to call.
  std::int64_t host_time(std::int64_t device_ns, std::int64_t host_ns);

  /// Rate of the host's clock relative to the device's, minus 1.
  double skew() const { return skew_; }
  /// Standard uncertainty of the offset, by the scatter of the smallest delays [ns]; 0 before the
  /// second window. The smallest delay itself is not seen.
  std::int64_t sigma_ns() const;
  /// Number of restarts of the estimate.
  std::uint64_t restarts() const { return restarts_; }

 private:
  void begin(std::int64_t device_ns, std::int64_t offset_ns);
  void close_window(std::int64_t device_ns);

  std::optional<std::int64_t> last_device_ns_;
  std::int64_t last_out_ns_ = 0;
  double offset_ns_ = 0.0;  // host - device, as used
  double skew_ = 0.0;
  double correction_ = 0.0;  // of the offset, per device time, in addition to the skew
  std::int64_t window_start_ns_ = 0;
  std::int64_t smallest_ns_ = 0;  // host - device in this window
  std::int64_t smallest_at_ns_ = 0;
  std::optional<std::int64_t> previous_smallest_ns_;
  std::int64_t previous_at_ns_ = 0;
  bool settled_ = false;
  double variance_ = 0.0;  // of the smallest delays [ns^2]
  std::uint64_t windows_ = 0;
  std::uint64_t restarts_ = 0;
};

}  // namespace stickslip::drivers
