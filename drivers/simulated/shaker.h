// What stands between the commanded drive and the rig: converter, amplifier and shaker.
#pragma once

#include "physics/model.h"
#include "physics/sensor_chain.h"

namespace stickslip::drivers {

/// Follows commands, one a cycle, as straight lines from each to the next, and so one cycle late,
/// through a four-pole Butterworth low-pass. Its acceleration is then continuous, and free of the
/// steps of the commands. With the amplifier off, a moving base is brought back to its middle by
/// its suspension, critically damped at 3 Hz, from where and how fast it was told to be; a force is
/// gone at once but for the low-pass. Owns no heap memory.
class Shaker {
 public:
  /// `steps`: parts of a cycle in which it moves.
  Shaker(physics::Excitation excitation, double bandwidth_hz, double period_s, int steps);

  /// What holds until the next command: displacement [m] or force [N]. A drive that is not finite
  /// is none: the amplifier counts as off.
  void command(double drive, bool amplifier_on);

  /// Begins a cycle; then `steps` calls of `advance`.
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
  double from_ = 0.0;  // of this cycle's straight line
  double to_ = 0.0;
  double rate_ = 0.0;  // at its end, per second
  int step_ = 0;       // steps of it that are done
};

}  // namespace stickslip::drivers
