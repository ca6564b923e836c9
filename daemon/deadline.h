// SPDX-License-Identifier: Apache-2.0
// Deadlines on a fixed grid of absolute monotonic time: an overrun costs cycles but never phase.
#pragma once

#include <cstdint>

namespace stickslip::daemon {

struct Deadline {
  std::int64_t due_ns = 0;   ///< in the past if the cycle is already late
  std::int64_t late_ns = 0;  ///< > 0: overrun; the cycle runs immediately
  std::int64_t skipped = 0;  ///< whole periods without a cycle

  friend constexpr bool operator==(const Deadline&, const Deadline&) = default;
};

/// The deadline after `previous_ns` at time `now_ns`, for period_ns > 0. A cycle that is late by
/// less than a period runs late; whole periods that have passed are skipped. `due_ns` is always
/// `previous_ns` plus a whole number of periods.
constexpr Deadline next_deadline(std::int64_t previous_ns, std::int64_t period_ns,
                                 std::int64_t now_ns) {
  const std::int64_t next_ns = previous_ns + period_ns;
  if (now_ns <= next_ns) return {next_ns, 0, 0};
  const std::int64_t skipped = (now_ns - next_ns) / period_ns;
  return {next_ns + skipped * period_ns, now_ns - next_ns, skipped};
}

}  // namespace stickslip::daemon
