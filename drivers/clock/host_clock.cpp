// SPDX-License-Identifier: Apache-2.0
#include "drivers/clock/host_clock.h"

#include <time.h>

#include <cerrno>

namespace stickslip::drivers {

namespace {
constexpr std::int64_t second_ns = 1'000'000'000;
}

std::int64_t MonotonicHostClock::now_ns() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<std::int64_t>(now.tv_sec) * second_ns + now.tv_nsec;
}

void MonotonicHostClock::sleep_until(std::int64_t due_ns) {
  const timespec due{due_ns / second_ns, due_ns % second_ns};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, nullptr) == EINTR) {
  }
}

}  // namespace stickslip::drivers
