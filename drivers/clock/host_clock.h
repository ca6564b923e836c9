// SPDX-License-Identifier: Apache-2.0
// The host's clock. Replaceable, so that tests need not sleep.
#pragma once

#include <cstdint>

namespace stickslip::drivers {

class HostClock {
 public:
  HostClock() = default;
  HostClock(const HostClock&) = delete;
  HostClock& operator=(const HostClock&) = delete;
  virtual ~HostClock() = default;

  virtual std::int64_t now_ns() = 0;
  /// Returns at `due_ns`, immediately if that is past.
  virtual void sleep_until(std::int64_t due_ns) = 0;
};

/// CLOCK_MONOTONIC.
class MonotonicHostClock final : public HostClock {
 public:
  std::int64_t now_ns() override;
  void sleep_until(std::int64_t due_ns) override;
};

}  // namespace stickslip::drivers
