// A contact that says "stop": pressing counts at once, letting go once it has lasted.
#pragma once

#include <cstdint>

namespace stickslip::drivers::gpio {

/// In software and not in the kernel, whose debouncing (2.x only) delays the pressing as well.
class Debounced {
 public:
  explicit Debounced(std::int64_t hold_ns) : hold_ns_(hold_ns) {}

  /// What counts, when the line was seen at `now_ns` to be active or not. At first it is active.
  bool update(bool active, std::int64_t now_ns) {
    if (active) {
      is_active_ = true;
      waits_ = false;
    } else if (is_active_ && !waits_) {
      waits_ = true;
      since_ns_ = now_ns;
    }
    if (waits_ && now_ns - since_ns_ >= hold_ns_) {
      is_active_ = false;
      waits_ = false;
    }
    return is_active_;
  }

 private:
  std::int64_t hold_ns_;
  std::int64_t since_ns_ = 0;
  bool is_active_ = true;
  bool waits_ = false;  // it is not active, but not for long enough
};

}  // namespace stickslip::drivers::gpio
