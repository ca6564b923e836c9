// The time that the loop lives by. Absolute, monotonic, and replaceable in tests.
#pragma once

#include <cstdint>

namespace stickslip::daemon {

class Clock {
 public:
  Clock() = default;
  Clock(const Clock&) = delete;
  Clock& operator=(const Clock&) = delete;
  virtual ~Clock() = default;

  virtual std::int64_t now_ns() = 0;
  /// Returns at `due_ns`, or at once where that is past. Signals do not end the wait.
  virtual void sleep_until(std::int64_t due_ns) = 0;
};

/// CLOCK_MONOTONIC: never set, never stepped, stands still while the machine is suspended.
class MonotonicClock final : public Clock {
 public:
  std::int64_t now_ns() override;
  void sleep_until(std::int64_t due_ns) override;
};

}  // namespace stickslip::daemon
