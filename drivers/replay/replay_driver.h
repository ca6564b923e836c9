// SPDX-License-Identifier: Apache-2.0
// Replay of a recording as a driver, bit for bit.
#pragma once

#include <time.h>

#include <vector>

#include "drivers/driver.h"

namespace stickslip::drivers {

/// Returns the recorded frames, each at its time since the start divided by `speed` (1: real time,
/// 0: as fast as possible), on the monotonic clock; then end_of_data. Drives nothing.
class ReplayDriver final : public Driver {
 public:
  ReplayDriver(std::vector<Frame> frames, double speed);

  Result open() override;
  Result start() override;
  /// Waits until the frame is due, at most a tenth of a second; no_data if it is due later.
  Result read(Frame& frame) override;
  Result write(const Actuation& actuation) override;
  void stop() noexcept override;
  void close() noexcept override;
  const Description& description() const override { return description_; }

 private:
  std::vector<Frame> frames_;
  double speed_;
  Description description_;
  std::size_t next_ = 0;
  std::int64_t started_ns_ = 0;
  bool open_ = false;
  bool running_ = false;
};

}  // namespace stickslip::drivers
