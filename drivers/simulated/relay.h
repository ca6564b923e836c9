// SPDX-License-Identifier: Apache-2.0
// Amplifier relay of the simulated rig in another process: a watchdog relay at the other end of a
// Unix socket, which receives its state in every cycle and opens after a time-out, so that the
// shaker stops even if the daemon is killed.
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

  /// needs_attention if no process listens at the socket.
  Result open();
  /// Sends one datagram, "1" or "0", without waiting; lost if no process listens any more.
  Result set(bool amplifier_on);
  void close() noexcept;

 private:
  std::filesystem::path socket_;
  std::string refusal_;
  int file_ = -1;
};

}  // namespace stickslip::drivers
