// The rig behind the emulated devices: one set of equations that all of them measure and drive, so
// that what a driver decodes can be held against the truth.
#pragma once

#include <cstdint>

#include "physics/frame.h"

namespace stickslip::emulated {

/// What the devices are wired to. Times are those of the test's clock [ns].
class Wires {
 public:
  virtual ~Wires() = default;
  /// What a perfect sensor of that channel says at that time, SI. Devices may ask for times that
  /// are a little older than what another one has asked for already.
  virtual double truth(Channel channel, std::int64_t time_ns) = 0;
  /// What the board's output holds from that time on [V].
  virtual void drive(double volts, std::int64_t time_ns) = 0;
  /// The enable contact of the amplifier.
  virtual void enable(bool on, std::int64_t time_ns) = 0;
  virtual bool amplifier_fault() const { return false; }
  virtual bool emergency_stop() const { return false; }
};

/// How a sensor turns a channel into what its device reads: electrical = offset + gain * SI.
struct Sensor {
  Channel channel = Channel::displacement;
  double gain = 1.0;    ///< [V, V/V or mm per SI unit]
  double offset = 0.0;  ///< [V, V/V or mm]
  double operator()(Wires& wires, std::int64_t time_ns) const {
    return offset + gain * wires.truth(channel, time_ns);
  }
};

}  // namespace stickslip::emulated
