// SPDX-License-Identifier: Apache-2.0
// Dynamics between the commanded drive and the rig: converter, amplifier and shaker.
#pragma once

#include "physics/model.h"
#include "physics/sensor_chain.h"

namespace stickslip::drivers {

/// Commands, one per cycle, are interpolated linearly, hence with a delay of one cycle, and
/// filtered by a four-pole Butterworth low-pass, so that the acceleration is continuous. With the
/// amplifier off, a moving base returns to its centre by its suspension, critically damped at 3 Hz,
/// from the commanded position and velocity; a force drops to zero through the low-pass. Owns no
/// heap memory.
class Shaker {
 public:
  /// `steps`: integration steps per cycle.
  Shaker(physics::Excitation excitation, double bandwidth_hz, double period_s, int steps);

  /// Displacement [m] or force [N] until the next command. With a drive that is not finite the
  /// amplifier counts as off.
  void command(double drive, bool amplifier_on);

  /// Begins a cycle; to be followed by `steps` calls of `advance`.
  void begin_cycle();
  void advance();

  double output() const { return filter_.output(memory_); }
  /// Second time derivative of the output, exact.
  double acceleration() const { return filter_.output_acceleration(memory_); }

 private:
  void release();

  physics::Excitation excitation_;
  double period_s_;
  int steps_;
  physics::FilterChain filter_;
  physics::FilterMemory<double> memory_;
  double drive_ = 0.0;
  bool amplifier_on_ = false;
  double from_ = 0.0;  // interpolation interval of this cycle
  double to_ = 0.0;
  double rate_ = 0.0;  // at its end, per second
  int step_ = 0;       // completed steps of the cycle
};

}  // namespace stickslip::drivers
