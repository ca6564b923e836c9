// A contact that says "stop": pressing counts at once and for a while, letting go once it has
// lasted.
#pragma once

#include <cstdint>
#include <limits>

namespace stickslip::drivers::gpio {

/// In software and not in the kernel, whose debouncing (2.x only) delays the pressing as well.
class Debounced {
 public:
  /// What was active counts as active for so long after it was last seen so, whatever the time of
  /// debouncing: everybody who looks several times in it gets to see a moment's pressing.
  static constexpr std::int64_t least_ns = 100'000'000;

  explicit Debounced(std::int64_t hold_ns) : hold_ns_(hold_ns) {}

  /// What counts, when the line was seen at `now_ns` to be active or not. At first it is active.
  bool update(bool active, std::int64_t now_ns) {
    if (active) {
      is_active_ = true;
      waits_ = false;
      pressed_until_ns_ = now_ns + least_ns;
    } else if (is_active_ && !waits_) {
      waits_ = true;
      since_ns_ = now_ns;
    }
    if (waits_ && now_ns - since_ns_ >= hold_ns_ && now_ns >= pressed_until_ns_) {
      is_active_ = false;
      waits_ = false;
    }
    return is_active_;
  }

 private:
  std::int64_t hold_ns_;
  std::int64_t since_ns_ = 0;
  std::int64_t pressed_until_ns_ = std::numeric_limits<std::int64_t>::min();  // never was, as yet
  bool is_active_ = true;
  bool waits_ = false;  // it is not active, but not for long enough
};

}  // namespace stickslip::drivers::gpio
