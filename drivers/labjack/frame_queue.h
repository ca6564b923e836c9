// SPDX-License-Identifier: Apache-2.0
// Frames on their way from the thread that receives a stream to the loop.
#pragma once

#include <semaphore.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "drivers/driver.h"
#include "physics/frame.h"

namespace stickslip::drivers::labjack {

/// A ring buffer between two threads. put and next do not allocate or lock.
class FrameQueue {
 public:
  explicit FrameQueue(std::size_t capacity);
  ~FrameQueue();
  FrameQueue(const FrameQueue&) = delete;
  FrameQueue& operator=(const FrameQueue&) = delete;

  /// If the loop does not read, the newest frames are lost, which the sequence shows.
  void put(const Frame& frame, const OutputReadings& outputs);
  /// The end of the stream: `next` returns what is left, and does not wait any more.
  void close();

  /// The next frame and the outputs as read back with it; waits for it at most that long.
  bool next(Frame& frame, OutputReadings& outputs, std::int64_t timeout_ns);

 private:
  struct Received {
    Frame frame;
    OutputReadings outputs;
  };
  std::vector<Received> frames_;
  // Each thread counts its own frames.
  std::atomic<std::uint64_t> made_{0};
  std::atomic<std::uint64_t> taken_{0};
  std::atomic<bool> closed_{false};
  sem_t available_{};
};

/// Two seconds of frames: a loop that is later than that has failed anyway.
std::size_t frame_capacity(double rate_hz);

}  // namespace stickslip::drivers::labjack
