// A serial line that is listened to: 8 bits, no parity, one stop bit, no handshake, every byte as
// it comes; for instruments that write lines by themselves. And what is to be done where a serial
// device cannot be opened, whoever opens it.
#pragma once

#include <cstdint>
#include <string>

#include "drivers/driver.h"
#include "drivers/host_clock.h"

namespace stickslip::drivers {

/// What became of opening a device, by errno: needs_attention where a person must do something
/// (permission, busy, no serial device), lost where it is not there.
Outcome outcome_of_opening(int error);
/// What a person does about a serial device that could not be opened with that errno.
std::string what_to_do_serially(const std::string& port, int error);

class SerialLine {
 public:
  SerialLine() = default;
  SerialLine(const SerialLine&) = delete;
  SerialLine& operator=(const SerialLine&) = delete;
  ~SerialLine() { close(); }

  /// Opens it anew, throws away what came before, and keeps other programs out. `why`: a sentence
  /// unless the outcome is ok; then it is needs_attention or lost.
  Outcome open(const std::string& port, int baud, std::string& why);
  bool is_open() const { return file_ >= 0; }
  /// Waits until there is something and appends it to `received`: ok, no_data at `until_ns`, or
  /// lost.
  Outcome receive(std::string& received, HostClock& clock, std::int64_t until_ns);
  /// How long so many bytes take on this line.
  std::int64_t duration_ns(std::size_t bytes) const;
  void close() noexcept;

 private:
  int file_ = -1;
  int baud_ = 0;
};

}  // namespace stickslip::drivers
