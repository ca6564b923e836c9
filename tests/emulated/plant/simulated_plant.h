// SPDX-License-Identifier: Apache-2.0
// Simulated rig measured and driven by all emulated devices, which provides the truth for
// comparison with decoded data.
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

/// The simulated rig without noise and quantisation, advanced by requests for later times. The
/// output voltage drives the shaker, one integration step late, converted to metres or newtons by
/// `shaker`; without the enable contact nothing moves. Any thread may call it.
class SimulatedPlant final : public Wires {
 public:
  static constexpr double step_s = 0.5e-3;
  /// Largest age of a request relative to the latest one.
  static constexpr double memory_s = 4.0;

  /// Begins at rest at `begin_ns` on the clock of the test. Throws std::runtime_error if the true
  /// model is invalid.
  SimulatedPlant(config::SimulatedDriver rig, const config::ShakerOutput& shaker,
                 std::int64_t begin_ns);

  /// Interpolated linearly between steps; before the recorded history: its first value.
  double truth(Channel channel, std::int64_t time_ns) override;
  /// All channels.
  Frame truth(std::int64_t time_ns);
  void drive(double volts, std::int64_t time_ns) override;
  void enable(bool on, std::int64_t time_ns) override;
  bool amplifier_fault() const override;
  bool emergency_stop() const override;

  void set_amplifier_fault(bool fault);
  void press_emergency_stop(bool pressed);
  /// State of the amplifier's contact, and the time of its last change.
  bool enabled() const;
  std::int64_t enabled_since_ns() const;
  /// Number of output updates.
  std::uint64_t drives() const;

 private:
  void advance_to(std::int64_t time_ns);
  void command();

  mutable std::mutex mutex_;
  drivers::SimulatedDriver rig_;
  config::ShakerOutput shaker_;
  std::int64_t begin_ns_;
  std::deque<Frame> past_;  // one per step; the latest last
  double volts_ = 0.0;
  std::uint64_t drives_ = 0;
  bool enabled_ = false;
  std::int64_t enabled_since_ns_ = 0;
  bool amplifier_fault_ = false;
  bool emergency_stop_ = false;
};

}  // namespace stickslip::emulated
