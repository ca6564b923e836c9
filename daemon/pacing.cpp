// SPDX-License-Identifier: Apache-2.0
#include "daemon/pacing.h"

#include "daemon/deadline.h"
#include "drivers/driver.h"

namespace stickslip::daemon {

Wakeup Pacer::wait(bool device_present) {
  switch (settings_.pacing) {
    case Pacing::deadlines:
      return wait_for_deadline();
    case Pacing::driver:
      return device_present ? leave_waiting_to_driver() : sleep_one_period();
    case Pacing::free_running:
      return device_present ? Wakeup{} : sleep_one_period();
  }
  return {};
}

Wakeup Pacer::wait_for_deadline() {
  const Deadline next = next_deadline(due_ns_, settings_.period_ns, clock_.now_ns());
  Wakeup out;
  out.elapsed_ns = next.due_ns - due_ns_;
  due_ns_ = next.due_ns;
  if (next.late_ns > 0 && !first_) {
    out.overrun_ns = next.late_ns;
    out.skipped = next.skipped;
  } else {
    clock_.sleep_until(due_ns_);
  }
  first_ = false;
  out.lateness_ns = clock_.now_ns() - due_ns_;
  out.late = out.overrun_ns > 0 || *out.lateness_ns > settings_.lateness_limit_ns;
  return out;
}

// A board goes on sampling while the loop is stalled and then delivers its buffered samples at
// once: the excitation would be played faster than intended.
Wakeup Pacer::leave_waiting_to_driver() {
  Wakeup out;
  if (!settings_.detect_stalls) return out;
  const std::int64_t now_ns = clock_.now_ns();
  const std::int64_t allowed_ns = drivers::longest_paced_wait_ns + settings_.lateness_limit_ns;
  if (previous_wait_ns_ && now_ns - *previous_wait_ns_ > allowed_ns) {
    out.overrun_ns = now_ns - *previous_wait_ns_ - drivers::longest_paced_wait_ns;
    out.late = true;
  }
  previous_wait_ns_ = now_ns;
  return out;
}

Wakeup Pacer::sleep_one_period() {
  previous_wait_ns_.reset();
  clock_.sleep_until(clock_.now_ns() + settings_.period_ns);
  return {};
}

}  // namespace stickslip::daemon
