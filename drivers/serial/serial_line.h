// SPDX-License-Identifier: Apache-2.0
// A serial line that is only received from, for instruments that transmit by themselves: 8 data
// bits, no parity, one stop bit, no handshake, raw bytes. Also the diagnosis of a serial device
// that cannot be opened.
#pragma once

#include <cstdint>
#include <string>

#include "drivers/clock/host_clock.h"
#include "drivers/driver.h"

namespace stickslip::drivers {

/// Outcome of a failed open by errno: needs_attention if an operator must act (permission, busy, no
/// serial device), lost if the device is absent.
Outcome open_outcome(int error);
/// Remedy for a serial device that could not be opened with that errno.
std::string serial_port_remedy(const std::string& port, int error);

class SerialLine {
 public:
  SerialLine() = default;
  SerialLine(const SerialLine&) = delete;
  SerialLine& operator=(const SerialLine&) = delete;
  ~SerialLine() { close(); }

  /// Reopens the line, discards earlier input, and excludes other programs. The outcome is ok,
  /// needs_attention or lost; `why` is a message unless it is ok.
  Outcome open(const std::string& port, int baud, std::string& why);
  bool is_open() const { return file_ >= 0; }
  /// Waits for bytes and appends them to `received`: ok, no_data at `until_ns`, or lost.
  Outcome receive(std::string& received, HostClock& clock, std::int64_t until_ns);
  /// Transmission time of a number of bytes.
  std::int64_t duration_ns(std::size_t bytes) const;
  void close() noexcept;

 private:
  int file_ = -1;
  int baud_ = 0;
};

}  // namespace stickslip::drivers
