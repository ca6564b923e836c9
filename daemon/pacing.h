// SPDX-License-Identifier: Apache-2.0
// The three ways of pacing the loop. Each is a function that waits for the next cycle and reports
// how late it came; everything else that depends on the pacing is answered here as well.
#pragma once

#include <cstdint>
#include <optional>

#include "daemon/clock.h"

namespace stickslip::daemon {

enum class Pacing : std::uint8_t {
  deadlines,     ///< the loop sleeps until absolute deadlines; a full ring loses frames
  driver,        ///< the driver waits in read(); a full ring loses frames
  free_running,  ///< no waiting: as fast as possible, and a full ring makes the loop wait
};

struct PacerSettings {
  Pacing pacing = Pacing::deadlines;
  std::int64_t period_ns = 1'000'000;          ///< > 0
  std::int64_t lateness_limit_ns = 1'000'000;  ///< of a wake-up before its cycle counts as late
  /// Pacing::driver: report a stall of the loop, after which buffered samples arrive in a burst.
  bool detect_stalls = false;
};

/// The start of a cycle.
struct Wakeup {
  std::int64_t elapsed_ns = 0;  ///< Pacing::deadlines: from the previous deadline to this one
  std::int64_t overrun_ns = 0;  ///< > 0: the previous cycle overran by this time
  std::int64_t skipped = 0;     ///< whole periods without a cycle
  std::optional<std::int64_t> lateness_ns = {};  ///< against the deadline, if there is one
  bool late = false;                             ///< beyond the limit of lateness
};

/// Neither allocates nor locks; calls nothing but the clock.
class Pacer {
 public:
  /// `clock` must outlive the pacer.
  Pacer(Clock& clock, const PacerSettings& settings) : clock_(clock), settings_(settings) {}

  /// Sets the origin of the deadlines: the first is one period after `origin_ns`.
  void start(std::int64_t origin_ns) { due_ns_ = origin_ns; }

  /// Waits until the next cycle is due. While a driver that paces the loop is absent, the loop
  /// sleeps one period instead.
  Wakeup wait(bool device_present);

  /// True if cycles have deadlines, so that their lateness and duration mean something.
  bool has_deadlines() const { return settings_.pacing == Pacing::deadlines; }
  /// True if the loop waits for slow consumers instead of losing frames.
  bool waits_for_consumers() const { return settings_.pacing == Pacing::free_running; }

 private:
  Wakeup wait_for_deadline();
  Wakeup leave_waiting_to_driver();
  Wakeup sleep_one_period();

  Clock& clock_;
  PacerSettings settings_;
  std::int64_t due_ns_ = 0;
  bool first_ = true;                             // no earlier deadline that could have been missed
  std::optional<std::int64_t> previous_wait_ns_;  // Pacing::driver: the latest call of wait()
};

}  // namespace stickslip::daemon
