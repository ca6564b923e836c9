// The simulated rig's amplifier as something that outlives the daemon: a watchdog relay at the
// other end of a Unix socket, told in every cycle whether it may be on. What hears nothing for a
// while lets go by itself; that is what keeps a shaker still whose daemon was killed.
#pragma once

#include <filesystem>
#include <string>

#include "drivers/driver.h"

namespace stickslip::drivers {

class Relay {
 public:
  explicit Relay(std::filesystem::path socket) : socket_(std::move(socket)) {}
  ~Relay();
  Relay(const Relay&) = delete;
  Relay& operator=(const Relay&) = delete;

  /// needs_attention where nobody listens at the socket.
  Result open();
  /// One datagram, "1" or "0", without waiting; lost where nobody listens any more.
  Result tell(bool amplifier_on);
  void close() noexcept;

 private:
  std::filesystem::path socket_;
  std::string refusal_;
  int file_ = -1;
};

}  // namespace stickslip::drivers
