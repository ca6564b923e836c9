// A recording behind the driver interface, bit for bit.
#pragma once

#include <time.h>

#include <vector>

#include "drivers/driver.h"

namespace stickslip::drivers {

/// Yields the frames as they are, each at its own time since the start divided by `speed` (1: as
/// recorded, 0: as fast as it goes), on the monotonic clock; then end_of_data. Drives nothing.
class ReplayDriver final : public Driver {
 public:
  ReplayDriver(std::vector<Frame> frames, double speed);

  Result open() override;
  Result start() override;
  /// Waits until the frame is due, a tenth of a second at most; no_data where it is due later.
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
