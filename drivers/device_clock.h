// The time of a device that counts with a crystal of its own, on the host's monotonic clock.
#pragma once

#include <cstdint>
#include <optional>

namespace stickslip::drivers {

/// A reading can only come late, never early: the smallest difference between host and device
/// within a window is the best view of their offset. From window to window it moves with the skew
/// of the two, which is estimated and clamped, and what is left of it is taken up slowly. The
/// result never runs backwards, not even where the device's clock or the host does. Does not
/// allocate.
class DeviceClock {
 public:
  /// Crystals are good to some 50 parts in a million; what looks like more is something else.
  static constexpr double largest_skew = 500e-6;
  /// Beyond this the two clocks have parted (a device that restarted, a machine that slept), and
  /// the correction begins anew.
  static constexpr std::int64_t parted_ns = 50'000'000;
  static constexpr std::int64_t window_ns = 1'000'000'000;

  /// The host's time [ns] of a sample that the device took at `device_ns` and that was read at
  /// `host_ns`. Increases strictly from call to call.
  std::int64_t host_time(std::int64_t device_ns, std::int64_t host_ns);

  /// Rate of the host's clock over the device's, minus 1.
  double skew() const { return skew_; }
  /// How often the correction had to begin anew after its first time.
  std::uint64_t restarts() const { return restarts_; }

 private:
  void begin(std::int64_t device_ns, std::int64_t offset_ns);
  void close_window(std::int64_t device_ns);

  std::optional<std::int64_t> last_device_ns_;
  std::int64_t last_out_ns_ = 0;
  double offset_ns_ = 0.0;  // host - device, as used
  double skew_ = 0.0;
  double correction_ = 0.0;  // of the offset, per device time, on top of the skew
  std::int64_t window_begun_ns_ = 0;
  std::int64_t smallest_ns_ = 0;  // host - device in this window
  std::int64_t smallest_at_ns_ = 0;
  std::optional<std::int64_t> previous_smallest_ns_;
  std::int64_t previous_at_ns_ = 0;
  bool settled_ = false;
  std::uint64_t windows_ = 0;
  std::uint64_t restarts_ = 0;
};

}  // namespace stickslip::drivers
