// A rig of equations behind the driver interface: shaker, oscillator, sensors and converter.
#pragma once

#include <memory>
#include <string>

#include "config/rig.h"
#include "drivers/driver.h"

namespace stickslip::drivers {

/// Yields one frame a cycle, at exact multiples of the period of its own clock, which starts at 0;
/// it does not wait (the loop keeps time). The commanded drive reaches the rig one period late, as
/// straight lines between commands through a four-pole Butterworth low-pass of the shaker's
/// bandwidth, so that the base's acceleration has no steps; with the amplifier off the command
/// counts as 0, and the base comes to rest through the same low-pass.
class SimulatedDriver final : public Driver {
 public:
  /// `period_s` is the time from one read to the next.
  SimulatedDriver(const config::SimulatedDriver& settings, double period_s);
  ~SimulatedDriver() override;

  Result open() override;
  Result start() override;
  Result read(Frame& frame) override;
  Result write(const Actuation& actuation) override;
  void stop() noexcept override;
  void close() noexcept override;
  const Description& description() const override { return description_; }

 private:
  struct Bench;
  config::SimulatedDriver settings_;
  double period_s_;
  Description description_;
  std::unique_ptr<Bench> bench_;
  bool running_ = false;
};

}  // namespace stickslip::drivers
