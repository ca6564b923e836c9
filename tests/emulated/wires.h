// SPDX-License-Identifier: Apache-2.0
// Connection of the emulated devices to a common rig, which provides the truth for comparison with
// decoded data.
#pragma once

#include <cstdint>

#include "physics/frame.h"

namespace stickslip::emulated {

/// Signals at the devices. Times are on the clock of the test [ns].
class Wires {
 public:
  virtual ~Wires() = default;
  /// True value of a channel at a time, SI. Times may be slightly older than those already
  /// requested by another device.
  virtual double truth(Channel channel, std::int64_t time_ns) = 0;
  /// Voltage of the board's output from that time on [V].
  virtual void drive(double volts, std::int64_t time_ns) = 0;
  /// State of the amplifier's enable contact.
  virtual void enable(bool on, std::int64_t time_ns) = 0;
  virtual bool amplifier_fault() const { return false; }
  virtual bool emergency_stop() const { return false; }
};

/// Sensor of a channel: electrical = offset + gain * SI.
struct Sensor {
  Channel channel = Channel::displacement;
  double gain = 1.0;    ///< [V, V/V or mm per SI unit]
  double offset = 0.0;  ///< [V, V/V or mm]
  double operator()(Wires& wires, std::int64_t time_ns) const {
    return offset + gain * wires.truth(channel, time_ns);
  }
};

}  // namespace stickslip::emulated
