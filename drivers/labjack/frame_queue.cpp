// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack/frame_queue.h"

#include <time.h>

#include <algorithm>
#include <cerrno>

namespace stickslip::drivers::labjack {

namespace {

timespec monotonic_in(std::int64_t ns) {
  timespec due{};
  clock_gettime(CLOCK_MONOTONIC, &due);
  due.tv_nsec += ns % 1'000'000'000;
  due.tv_sec += ns / 1'000'000'000 + due.tv_nsec / 1'000'000'000;
  due.tv_nsec %= 1'000'000'000;
  return due;
}

}  // namespace

std::size_t frame_capacity(double rate_hz) {
  return static_cast<std::size_t>(std::max(1024.0, 2.0 * rate_hz));
}

FrameQueue::FrameQueue(std::size_t capacity) : frames_(capacity) { sem_init(&available_, 0, 0); }

FrameQueue::~FrameQueue() { sem_destroy(&available_); }

void FrameQueue::put(const Frame& frame, const OutputReadings& outputs) {
  const std::uint64_t made = made_.load(std::memory_order_relaxed);
  if (made - taken_.load(std::memory_order_acquire) == frames_.size()) return;
  frames_[made % frames_.size()] = {frame, outputs};
  made_.store(made + 1, std::memory_order_release);
  sem_post(&available_);
}

void FrameQueue::close() {
  if (!closed_.exchange(true, std::memory_order_acq_rel)) sem_post(&available_);
}

bool FrameQueue::next(Frame& frame, OutputReadings& outputs, std::int64_t timeout_ns) {
  if (sem_trywait(&available_) != 0) {
    if (closed_.load(std::memory_order_acquire)) return false;
    const timespec due = monotonic_in(timeout_ns);
    int waited = 0;
    do {
      waited = sem_clockwait(&available_, CLOCK_MONOTONIC, &due);
    } while (waited != 0 && errno == EINTR);
    if (waited != 0) return false;
  }
  const std::uint64_t taken = taken_.load(std::memory_order_relaxed);
  if (taken == made_.load(std::memory_order_acquire)) return false;  // woken by the end
  const Received& received = frames_[taken % frames_.size()];
  frame = received.frame;
  outputs = received.outputs;
  taken_.store(taken + 1, std::memory_order_release);
  return true;
}

}  // namespace stickslip::drivers::labjack
