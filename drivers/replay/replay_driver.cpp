// SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/replay_driver.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <utility>

namespace stickslip::drivers {

namespace {

constexpr std::int64_t longest_wait_ns = 100'000'000;
constexpr double farthest_ns = 1.0e18;  // thirty years; keeps a slow replay within 64 bits

std::int64_t monotonic_ns() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

void wait_until(std::int64_t when_ns) {
  const timespec when{when_ns / 1'000'000'000, when_ns % 1'000'000'000};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &when, nullptr) == EINTR) {
  }
}

}  // namespace

ReplayDriver::ReplayDriver(std::vector<Frame> frames, double speed)
    : frames_(std::move(frames)), speed_(speed) {
  description_.name = "replay of a recording";
  description_.paced = speed_ > 0.0;
  for (const Channel channel : all_channels) {
    description_.unit[index_of(channel)] = info(channel).unit.data();
  }
  for (const Frame& frame : frames_) description_.channels |= frame.valid;
}

Result ReplayDriver::open() {
  if (frames_.empty()) return {Outcome::needs_attention, "the recording to replay holds no frames"};
  open_ = true;
  return {};
}

Result ReplayDriver::start() {
  if (!open_) return {Outcome::fatal, "start of a replay that is not open"};
  started_ns_ = monotonic_ns();
  next_ = 0;
  running_ = true;
  return {};
}

Result ReplayDriver::read(Frame& frame) {
  if (!running_) return {Outcome::fatal, "read of a replay that is not started"};
  if (next_ == frames_.size()) return {Outcome::end_of_data, ""};
  const Frame& due = frames_[next_];
  if (speed_ > 0.0) {
    const auto since_first = static_cast<double>(due.time_ns - frames_.front().time_ns);
    const std::int64_t when_ns =
        started_ns_ + std::llround(std::min(since_first / speed_, farthest_ns));
    const std::int64_t latest_ns = monotonic_ns() + longest_wait_ns;
    if (when_ns > latest_ns) {
      wait_until(latest_ns);
      return {Outcome::no_data, ""};
    }
    wait_until(when_ns);
  }
  frame = due;
  ++next_;
  return {};
}

Result ReplayDriver::write(const Actuation& /*actuation*/) { return {}; }

void ReplayDriver::stop() noexcept { running_ = false; }

void ReplayDriver::close() noexcept {
  running_ = false;
  open_ = false;
}

}  // namespace stickslip::drivers
