// SPDX-License-Identifier: Apache-2.0
#include "drivers/clock/stream_clock.h"

#include <algorithm>

namespace stickslip::drivers {

namespace {
constexpr std::int64_t longest_hold_ns = 50'000'000;
}  // namespace

StreamClock::StreamClock() { frames_.reserve(most_held); }

void StreamClock::restart() {
  clock_ = DeviceClock();
  known_ = false;
  frames_.clear();
  taken_ = 0;
  any_packet_ = false;
}

void StreamClock::take(const Frame& frame, std::int64_t host_ns) {
  if (known_) {
    frames_.push_back(frame);
    frames_.back().time_ns = clock_.host_time(frame.time_ns, host_ns);
    return;
  }
  const bool caught_up = has_caught_up(frame.time_ns, host_ns);
  frames_.push_back(frame);
  const bool at_limit = frames_.size() == most_held || host_ns - first_host_ns_ >= longest_hold_ns;
  if (caught_up || at_limit) place_all();
}

bool StreamClock::has_caught_up(std::int64_t device_ns, std::int64_t host_ns) {
  const std::int64_t delay_ns = host_ns - device_ns;
  bool caught_up = false;
  if (frames_.empty()) {
    first_host_ns_ = host_ns;
    smallest_ns_ = delay_ns;
  } else if (2 * (host_ns - last_host_ns_) >= device_ns - last_device_ns_) {
    // It was waited for: a packet ended before it.
    caught_up =
        any_packet_ && 2 * (smallest_before_ns_ - smallest_ns_) <= last_device_ns_ - packet_end_ns_;
    any_packet_ = true;
    packet_end_ns_ = last_device_ns_;
    smallest_before_ns_ = smallest_ns_;
  }
  smallest_ns_ = std::min(smallest_ns_, delay_ns);
  last_host_ns_ = host_ns;
  last_device_ns_ = device_ns;
  return caught_up;
}

void StreamClock::found_nothing() {
  if (!known_ && !frames_.empty()) place_all();
}

void StreamClock::place_all() {
  for (Frame& frame : frames_) {
    frame.time_ns = clock_.host_time(frame.time_ns, frame.time_ns + smallest_ns_);
  }
  known_ = true;
}

bool StreamClock::next(Frame& frame) {
  if (!known_ || frames_.empty()) return false;
  frame = frames_[taken_++];
  if (taken_ == frames_.size()) {
    frames_.clear();
    taken_ = 0;
  }
  return true;
}

}  // namespace stickslip::drivers
