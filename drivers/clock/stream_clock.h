// SPDX-License-Identifier: Apache-2.0
// Frames of a board with its own crystal, on the host's clock, from the first frame of a stream on.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "drivers/clock/device_clock.h"
#include "physics/frame.h"

namespace stickslip::drivers {

/// A stream begins with a burst: the frames that the board measured before the first one was read.
/// All are late, the first the most, so that their arrivals do not show when they were measured.
/// They are held until the reader has caught up with the board, and then placed by the board's
/// clock, backwards from the frame with the shortest delay.
///
/// The reader has caught up once the frames read without a wait (a packet) do not shorten the
/// smallest delay by more than half of their duration. It takes the burst and two packets, at most
/// 50 ms; a read that finds nothing ends it as well, so that packets of more than 20 ms are placed
/// with an error of up to their own length. take and next do not allocate.
class StreamClock {
 public:
  static constexpr std::size_t most_held = 4096;  ///< frames

  StreamClock();

  /// Begins a stream: forgets all frames and delays.
  void restart();
  /// A frame with the board's time, read at `host_ns`. The next follows only after next() was
  /// false.
  void take(const Frame& frame, std::int64_t host_ns);
  /// A read waited for a frame in vain.
  void found_nothing();
  /// The next frame, with its time on the host's clock. False: none, or its time is not known yet.
  bool next(Frame& frame);

  /// Standard uncertainty of the frames' times [ns]; 0 in the first two seconds.
  std::int64_t sigma_ns() const { return clock_.sigma_ns(); }
  /// Restarts of the estimate of this stream's clock, after a step of either clock.
  std::uint64_t restarts() const { return clock_.restarts(); }

 private:
  bool has_caught_up(std::int64_t device_ns, std::int64_t host_ns);
  void place_all();

  DeviceClock clock_;
  bool known_ = false;
  std::vector<Frame> frames_;  // held, or placed and not taken yet
  std::size_t taken_ = 0;
  std::int64_t first_host_ns_ = 0;
  std::int64_t last_host_ns_ = 0;
  std::int64_t last_device_ns_ = 0;
  std::int64_t smallest_ns_ = 0;  // host - device
  // At the end of the previous packet; before the second there is none.
  bool any_packet_ = false;
  std::int64_t packet_end_ns_ = 0;  // device time
  std::int64_t smallest_before_ns_ = 0;
};

}  // namespace stickslip::drivers
