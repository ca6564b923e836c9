// SPDX-License-Identifier: Apache-2.0
// Debouncing of a stop contact: pressing takes effect immediately and for a minimum time, release
// only after it has persisted.
#pragma once

#include <cstdint>
#include <limits>

namespace stickslip::drivers::gpio {

/// In software, as the kernel's debouncing (libgpiod 2.x only) delays the pressing as well.
class Debounced {
 public:
  /// Minimum active time after the latest active sample, whatever the debouncing time, so that
  /// every periodic observer sees a brief pressing.
  static constexpr std::int64_t min_active_ns = 100'000'000;

  explicit Debounced(std::int64_t hold_ns) : hold_ns_(hold_ns) {}

  /// Debounced state after a sample of the line at `now_ns`. Initially active.
  bool update(bool active, std::int64_t now_ns) {
    if (active) {
      is_active_ = true;
      releasing_ = false;
      pressed_until_ns_ = now_ns + min_active_ns;
    } else if (is_active_ && !releasing_) {
      releasing_ = true;
      since_ns_ = now_ns;
    }
    if (releasing_ && now_ns - since_ns_ >= hold_ns_ && now_ns >= pressed_until_ns_) {
      is_active_ = false;
      releasing_ = false;
    }
    return is_active_;
  }

 private:
  std::int64_t hold_ns_;
  std::int64_t since_ns_ = 0;
  std::int64_t pressed_until_ns_ = std::numeric_limits<std::int64_t>::min();  // never
  bool is_active_ = true;
  bool releasing_ = false;  // inactive, but not for long enough
};

}  // namespace stickslip::drivers::gpio
