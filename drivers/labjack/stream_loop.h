// SPDX-License-Identifier: Apache-2.0
// The loop at a LabJack board that streams: the wait for a frame, and the result of a write.
#pragma once

#include <cstdint>

#include "drivers/clock/host_clock.h"
#include "drivers/driver.h"
#include "drivers/labjack/streaming_output.h"
#include "physics/frame.h"

namespace stickslip::drivers::labjack {

/// Longest wait for a frame, and a part of it while a set-point is pending.
inline constexpr std::int64_t read_timeout_ns = longest_paced_wait_ns;
inline constexpr std::int64_t slice_ns = 500'000;

/// Frames arrive in bursts, one packet at a time, and so do the set-points of a loop that waits for
/// them: the newest is sent during the wait, once its predecessor has arrived. `Session` has next()
/// and has_ended().
template <class Session>
bool wait_for_frame(Session& session, StreamingOutput& output, HostClock& clock, Frame& frame,
                    OutputReadings& outputs) {
  std::int64_t left_ns = read_timeout_ns;
  while (output.has_pending_set_point() && left_ns > 0) {
    if (session.next(frame, outputs, slice_ns)) return true;
    if (session.has_ended()) return false;
    left_ns -= slice_ns;
    output.send_pending_set_point(clock.now_ns());
  }
  return left_ns > 0 && session.next(frame, outputs, left_ns);
}

/// The result of a write, once its command was applied.
inline Result result_of_write(StreamingOutput& output, bool finite) {
  if (!finite) return {Outcome::fatal, "the commanded drive is not finite"};
  if (output.tripped()) {
    return {Outcome::temporary,
            "no command was confirmed within watchdog_s, so the board's watchdog has disabled the "
            "amplifier; it stays off until an off command resets it"};
  }
  const char* const failure = output.report_failure();
  return failure == nullptr ? Result{} : Result{Outcome::temporary, failure};
}

}  // namespace stickslip::drivers::labjack
