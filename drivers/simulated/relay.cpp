// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulated/relay.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace stickslip::drivers {

Relay::~Relay() { close(); }

Result Relay::open() {
  close();
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string name = socket_.string();
  if (name.size() >= sizeof address.sun_path) {
    refusal_ = "the relay's socket " + name + " has too long a name";
    return {Outcome::needs_attention, refusal_.c_str()};
  }
  name.copy(address.sun_path, name.size());
  file_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (file_ < 0 ||
      ::connect(file_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    refusal_ = "no relay listens at " + name + ": " + std::strerror(errno);
    close();
    return {Outcome::needs_attention, refusal_.c_str()};
  }
  return {};
}

Result Relay::set(bool amplifier_on) {
  const char word = amplifier_on ? '1' : '0';
  if (::send(file_, &word, 1, MSG_NOSIGNAL) == 1) return {};
  if (errno == EAGAIN) return {Outcome::temporary, "the relay does not keep up"};
  return {Outcome::lost, "the relay is disconnected"};
}

void Relay::close() noexcept {
  if (file_ >= 0) ::close(file_);
  file_ = -1;
}

}  // namespace stickslip::drivers
