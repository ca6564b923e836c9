// SPDX-License-Identifier: Apache-2.0
#include "drivers/serial/serial_line.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <map>

namespace stickslip::drivers {

namespace {

const std::map<int, speed_t>& speeds() {
  static const std::map<int, speed_t> by_baud = {
      {300, B300},       {600, B600},       {1200, B1200},     {2400, B2400},   {4800, B4800},
      {9600, B9600},     {19200, B19200},   {38400, B38400},   {57600, B57600}, {115200, B115200},
      {230400, B230400}, {460800, B460800}, {921600, B921600},
  };
  return by_baud;
}

/// On failure errno is set.
bool configure_line(int file, speed_t speed) {
  termios line{};
  if (::tcgetattr(file, &line) != 0) return false;
  ::cfmakeraw(&line);
  line.c_cflag = (line.c_cflag & ~tcflag_t{CSTOPB | CRTSCTS}) | CLOCAL | CREAD;
  return ::cfsetspeed(&line, speed) == 0 && ::tcsetattr(file, TCSANOW, &line) == 0 &&
         ::ioctl(file, TIOCEXCL) == 0 && ::tcflush(file, TCIFLUSH) == 0;
}

}  // namespace

Outcome open_outcome(int error) {
  switch (error) {
    case EACCES:
    case EPERM:
    case EBUSY:
    case EINVAL:
    case ENOTTY:
      return Outcome::needs_attention;
    default:
      return Outcome::lost;
  }
}

std::string serial_port_remedy(const std::string& port, int error) {
  switch (error) {
    case ENOENT:
    case ENXIO:
    case ENODEV:
      return "the adapter is not plugged in, or has another name: ls -l /dev/serial/by-id";
    case EACCES:
    case EPERM:
      return "serial ports belong to the group dialout: join it with `sudo usermod -aG dialout "
             "$USER`, and log in again";
    case EBUSY:
      return "another program uses it: fuser -v " + port;
    case ENOTTY:
      return "that is not a serial port";
    case EINVAL:
      return "the port refuses these line settings";
    default:
      return "unplug the adapter and plug it in again";
  }
}

Outcome SerialLine::open(const std::string& port, int baud, std::string& why) {
  close();
  const auto speed = speeds().find(baud);
  if (speed == speeds().end()) {
    why = "a serial line does not support " + std::to_string(baud) + " Bd; it supports";
    for (const auto& each : speeds()) why.append(" ").append(std::to_string(each.first));
    return Outcome::needs_attention;
  }
  baud_ = baud;
  file_ = ::open(port.c_str(), O_RDONLY | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (file_ >= 0 && configure_line(file_, speed->second)) return Outcome::ok;
  const int error = errno;
  close();
  why =
      port + " cannot be opened (" + std::strerror(error) + "): " + serial_port_remedy(port, error);
  return open_outcome(error);
}

Outcome SerialLine::receive(std::string& received, HostClock& clock, std::int64_t until_ns) {
  for (;;) {
    const std::int64_t left_ns = std::max<std::int64_t>(until_ns - clock.now_ns(), 0);
    pollfd waited{file_, POLLIN, 0};
    if (::poll(&waited, 1, static_cast<int>(left_ns / 1'000'000)) == 0) return Outcome::no_data;
    std::array<char, 4096> bytes;
    const ssize_t got = ::read(file_, bytes.data(), bytes.size());
    if (got > 0) {
      received.append(bytes.data(), static_cast<std::size_t>(got));
      return Outcome::ok;
    }
    if (got == 0 || (errno != EAGAIN && errno != EINTR)) return Outcome::lost;
  }
}

std::int64_t SerialLine::duration_ns(std::size_t bytes) const {
  // A start bit, eight and a stop bit.
  return baud_ > 0 ? static_cast<std::int64_t>(bytes) * 10'000'000'000 / baud_ : 0;
}

void SerialLine::close() noexcept {
  if (file_ < 0) return;
  ::ioctl(file_, TIOCNXCL);  // otherwise it stays exclusive while another process has it open
  ::close(file_);
  file_ = -1;
}

}  // namespace stickslip::drivers
