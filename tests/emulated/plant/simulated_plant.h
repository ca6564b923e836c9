// The rig behind the emulated devices: one set of equations that all of them measure and drive, so
// that what a driver decodes can be held against the truth.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>

#include "config/bench.h"
#include "config/rig.h"
#include "drivers/simulated/simulated_driver.h"
#include "physics/frame.h"
#include "tests/emulated/wires.h"

namespace stickslip::emulated {

/// The simulated rig without its noise and its converter's steps, moved on by whoever asks for the
/// latest time. The output's volts reach the shaker, one step of its equations late, as
/// `shaker` turns them back into metres or newtons; without the enable contact nothing moves. Any
/// thread may ask.
class SimulatedPlant final : public Wires {
 public:
  static constexpr double step_s = 0.5e-3;
  /// What is asked for may be so much older than what was asked for before.
  static constexpr double memory_s = 4.0;

  /// Begins at rest at `begin_ns` on the test's clock. Throws std::runtime_error where the truth is
  /// no sound model.
  SimulatedPlant(config::SimulatedDriver rig, const config::ShakerOutput& shaker,
                 std::int64_t begin_ns);

  /// In between steps the truth is a straight line. Before the plant's memory: what it remembers
  /// first.
  double truth(Channel channel, std::int64_t time_ns) override;
  /// All channels at once.
  Frame truth(std::int64_t time_ns);
  void drive(double volts, std::int64_t time_ns) override;
  void enable(bool on, std::int64_t time_ns) override;
  bool amplifier_fault() const override;
  bool emergency_stop() const override;

  void set_amplifier_fault(bool fault);
  void press_emergency_stop(bool pressed);
  /// Whether the amplifier is enabled, and since when its contact is as it is.
  bool enabled() const;
  std::int64_t enabled_since_ns() const;
  /// How often the output was given a value.
  std::uint64_t drives() const;

 private:
  void advance_to(std::int64_t time_ns);
  void command();

  mutable std::mutex mutex_;
  drivers::SimulatedDriver rig_;
  config::ShakerOutput shaker_;
  std::int64_t begin_ns_;
  std::deque<Frame> past_;  // one a step; the latest last
  double volts_ = 0.0;
  std::uint64_t drives_ = 0;
  bool enabled_ = false;
  std::int64_t enabled_since_ns_ = 0;
  bool amplifier_fault_ = false;
  bool emergency_stop_ = false;
};

}  // namespace stickslip::emulated
