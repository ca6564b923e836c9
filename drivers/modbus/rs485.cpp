// SPDX-License-Identifier: Apache-2.0
#include "drivers/modbus/rs485.h"

#include <linux/serial.h>
#include <sys/ioctl.h>
#include <termios.h>

#include <cerrno>
#include <cstdint>
#include <cstring>

#include "drivers/serial/serial_line.h"

namespace stickslip::drivers::modbus {

namespace {

using config::Rs485Direction;
using config::RtsState;

RtsState other(RtsState state) {
  return state == RtsState::asserted ? RtsState::released : RtsState::asserted;
}

bool set_rts(int file, RtsState state) {
  const int line = TIOCM_RTS;
  return ::ioctl(file, state == RtsState::asserted ? TIOCMBIS : TIOCMBIC, &line) == 0;
}

/// 0 or errno. Delays and termination, as declared by the firmware of a board, are kept.
int enable_kernel(int file, RtsState while_sending) {
  serial_rs485 line{};
  const bool readable = ::ioctl(file, TIOCGRS485, &line) == 0;
  const std::uint32_t rts =
      while_sending == RtsState::asserted ? SER_RS485_RTS_ON_SEND : SER_RS485_RTS_AFTER_SEND;
  const std::uint32_t all = SER_RS485_ENABLED | SER_RS485_RTS_ON_SEND | SER_RS485_RTS_AFTER_SEND;
  // A received request would pass for the reply to a write, which repeats it.
  line.flags &= ~(all | SER_RS485_RX_DURING_TX);
  line.flags |= SER_RS485_ENABLED | rts;
  if (::ioctl(file, TIOCSRS485, &line) != 0) return errno;
  // Drivers accept a state of RTS that they do not support, and use the other.
  if (!readable || ::ioctl(file, TIOCGRS485, &line) != 0) return 0;
  return (line.flags & all) == (SER_RS485_ENABLED | rts) ? 0 : EINVAL;
}

/// 0 or errno.
int begin_to_receive(int file, RtsState while_sending) {
  // While the port's driver switches RTS, it ignores requests to set it.
  serial_rs485 line{};
  if (::ioctl(file, TIOCGRS485, &line) == 0 && (line.flags & SER_RS485_ENABLED) != 0) {
    line.flags &= ~std::uint32_t{SER_RS485_ENABLED};
    if (::ioctl(file, TIOCSRS485, &line) != 0) return errno;
  }
  return set_rts(file, other(while_sending)) ? 0 : errno;
}

std::int64_t transmission_ns(const config::ModbusUnit& unit, std::size_t bytes) {
  const int bits_per_character = 9 + (unit.parity == 'N' ? 0 : 1) + unit.stop_bits;
  return static_cast<std::int64_t>(bytes) * bits_per_character * 1'000'000'000 / unit.baud;
}

}  // namespace

int prepare_direction(int file, const config::ModbusUnit& unit, std::string& why) {
  if (unit.direction == Rs485Direction::automatic) return 0;
  const bool by_kernel = unit.direction == Rs485Direction::kernel;
  const int error = by_kernel ? enable_kernel(file, unit.rts_while_sending)
                              : begin_to_receive(file, unit.rts_while_sending);
  if (error == 0) return 0;
  why = unit.port + ": its driver does not " +
        (by_kernel ? "switch an RS-485 line (TIOCSRS485 with RTS " +
                         std::string(name_of(unit.rts_while_sending)) + " while sending: "
                   : "set RTS (TIOCMBIS, TIOCMBIC: ") +
        std::strerror(error) + "): ";
  if (error == ENOTTY || error == EINVAL) {
    why += std::string("set direction = ") + (by_kernel ? "\"rts\"" : "\"kernel\"") +
           ", or use an adapter that switches by itself, with direction = \"automatic\"";
  } else {
    why += serial_port_remedy(unit.port, error);
  }
  return error;
}

Transmission::Transmission(int file, const config::ModbusUnit& unit, HostClock& clock)
    : file_(file), unit_(unit), clock_(clock) {
  if (unit.direction != Rs485Direction::rts) return;
  sending_ = true;
  begun_ = set_rts(file, unit.rts_while_sending);
}

Transmission::~Transmission() {
  if (!sending_) return;
  const int error = errno;
  set_rts(file_, other(unit_.rts_while_sending));
  errno = error;
}

bool Transmission::finish(std::size_t bytes) {
  if (!sending_) return true;
  // First the time of the transmission: some adapters do not report its end, and the kernel looks
  // for it only once per tick, except immediately.
  clock_.sleep_until(clock_.now_ns() + transmission_ns(unit_, bytes));
  while (::tcdrain(file_) != 0) {
    if (errno != EINTR) return false;
  }
  if (!set_rts(file_, other(unit_.rts_while_sending))) return false;
  sending_ = false;
  return true;
}

}  // namespace stickslip::drivers::modbus
