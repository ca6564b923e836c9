// When the next cycle is due. Deadlines live on a grid of absolute monotonic time that never moves,
// so an overrun costs cycles but never phase.
#pragma once

#include <cstdint>

namespace stickslip::daemon {

/// What arming the next deadline found.
struct Deadline {
  std::int64_t due_ns = 0;   ///< when the cycle is due; in the past where it is already late
  std::int64_t late_ns = 0;  ///< > 0: an overrun, by this much; the cycle runs at once
  std::int64_t skipped = 0;  ///< whole periods for which no cycle ran and none will

  friend constexpr bool operator==(const Deadline&, const Deadline&) = default;
};

/// The deadline after `previous_ns`, seen at `now_ns`, with period_ns > 0. A cycle that is late by
/// less than a period is run late and none is lost; whole periods that have passed are skipped. The
/// result is always `previous_ns` plus a whole number of periods.
constexpr Deadline next_deadline(std::int64_t previous_ns, std::int64_t period_ns,
                                 std::int64_t now_ns) {
  const std::int64_t next_ns = previous_ns + period_ns;
  if (now_ns <= next_ns) return {next_ns, 0, 0};
  const std::int64_t skipped = (now_ns - next_ns) / period_ns;
  return {next_ns + skipped * period_ns, now_ns - next_ns, skipped};
}

}  // namespace stickslip::daemon
