// SPDX-License-Identifier: Apache-2.0
// Simulated rig as a driver: shaker, oscillator, sensors and converter.
#pragma once

#include <memory>
#include <string>

#include "config/rig.h"
#include "drivers/driver.h"
#include "drivers/simulated/relay.h"

namespace stickslip::drivers {

/// One frame per read, at exact multiples of the period on its own clock, which starts at 0 when it
/// is opened; it does not wait (the loop paces it) and loses no frame. Commands act through a
/// Shaker. The same settings and commands give the same frames, bit for bit.
class SimulatedDriver final : public Driver {
 public:
  /// `period_s`: time from frame to frame.
  SimulatedDriver(const config::SimulatedDriver& settings, double period_s);
  ~SimulatedDriver() override;

  Result open() override;
  Result start() override;
  Result read(Frame& frame) override;
  /// Before start, after stop, and with a drive that is not finite, the amplifier stays off.
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
  std::unique_ptr<Relay> relay_;  // null: the amplifier is part of the model
  std::string refusal_;
  bool running_ = false;
};

}  // namespace stickslip::drivers
