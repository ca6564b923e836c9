// A rig of equations behind the driver interface: shaker, oscillator, sensors and converter.
#pragma once

#include <memory>
#include <string>

#include "config/rig.h"
#include "drivers/driver.h"
#include "drivers/simulated/relay.h"

namespace stickslip::drivers {

/// Yields one frame a cycle, at exact multiples of the period of its own clock, which starts at 0
/// when it is opened; it does not wait (the loop keeps time), and no frame is ever missing. What is
/// commanded reaches the rig through a Shaker. The same settings and commands give the same frames
/// to the bit.
class SimulatedDriver final : public Driver {
 public:
  /// `period_s` is the time from one read to the next.
  SimulatedDriver(const config::SimulatedDriver& settings, double period_s);
  ~SimulatedDriver() override;

  Result open() override;
  Result start() override;
  Result read(Frame& frame) override;
  /// Before start, after stop, and where the drive is not finite, the amplifier stays off.
  Result write(const Actuation& actuation) override;
  void stop() noexcept override;
  void close() noexcept override;
  const Description& description() const override { return description_; }

 private:
  struct Bench;
  Result open_relay();
  config::SimulatedDriver settings_;
  double period_s_;
  Description description_;
  std::unique_ptr<Bench> bench_;
  std::unique_ptr<Relay> relay_;  // null: the amplifier is part of the equations
  std::string refusal_;
  bool running_ = false;
};

}  // namespace stickslip::drivers
