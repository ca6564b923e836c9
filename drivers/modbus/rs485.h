// SPDX-License-Identifier: Apache-2.0
// Direction of a two-wire RS-485 line whose adapter does not switch by itself: its transceiver
// sends in one state of the port's RTS line, and receives in the other.
#pragma once

#include <cstddef>
#include <string>

#include "config/bench.h"
#include "drivers/clock/host_clock.h"

namespace stickslip::drivers::modbus {

/// Prepares the opened serial port of a unit for its direction: kernel sets up the port's driver,
/// rts begins to receive. 0, or errno and a message in `why`.
int prepare_direction(int file, const config::ModbusUnit& unit, std::string& why);

/// One message on the line. With direction rts the transceiver sends from construction until
/// finish(), or destruction if that is earlier; with the other directions nothing is done.
class Transmission {
 public:
  Transmission(int file, const config::ModbusUnit& unit, HostClock& clock);
  /// Keeps errno.
  ~Transmission();
  Transmission(const Transmission&) = delete;
  Transmission& operator=(const Transmission&) = delete;

  /// False if the transceiver could not be switched, with errno.
  bool begun() const { return begun_; }
  /// Waits until the last bit of the message has left, and switches to receiving at once. False on
  /// failure, with errno. `bytes`: all of the message, which has been written to the port.
  bool finish(std::size_t bytes);

 private:
  int file_;
  const config::ModbusUnit& unit_;
  HostClock& clock_;
  bool sending_ = false;
  bool begun_ = true;
};

}  // namespace stickslip::drivers::modbus
