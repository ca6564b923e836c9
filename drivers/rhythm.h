// Counts what a device that speaks by itself should have said: its interval is learned.
#pragma once

#include <cstdint>

namespace stickslip::drivers {

class Rhythm {
 public:
  /// `usual_ns`: the interval to begin with; what is learned stays within half and twice of it.
  /// `begin_ns`: from when on the device can be heard.
  explicit Rhythm(std::int64_t usual_ns = 100'000'000, std::int64_t begin_ns = 0)
      : usual_ns_(static_cast<double>(usual_ns)),
        last_ns_(static_cast<double>(begin_ns)),
        interval_ns_(usual_ns_) {}

  /// By `time_ns`, `messages` more have come, well or not: how many are missing that were not told
  /// before. A message is missing once it is late by three quarters of the interval.
  std::uint64_t take(std::int64_t time_ns, std::uint64_t messages);

 private:
  double usual_ns_;
  double last_ns_;  // when the last message came, or should have
  double interval_ns_;
};

}  // namespace stickslip::drivers
