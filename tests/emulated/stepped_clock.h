// SPDX-License-Identifier: Apache-2.0
// Time in tests of drivers: a clock that only the test advances, and a wait without a deadline that
// a busy host could miss.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <thread>

#include "drivers/clock/host_clock.h"

namespace stickslip::emulated {

/// A clock that the test advances. Any thread may read it.
class SteppedClock final : public drivers::HostClock {
 public:
  std::int64_t now_ns() override { return now_; }
  void sleep_until(std::int64_t due_ns) override { now_ = std::max(now_.load(), due_ns); }
  void pass(std::int64_t ns) { now_ += ns; }

 private:
  std::atomic<std::int64_t> now_{1'000'000'000};
};

/// Waits until the condition holds. False after half a minute.
template <class Condition>
bool eventually(Condition holds) {
  using std::chrono::steady_clock;
  const auto end = steady_clock::now() + std::chrono::seconds(30);
  while (!holds()) {
    if (steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  }
  return true;
}

}  // namespace stickslip::emulated
