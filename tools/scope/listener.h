// SPDX-License-Identifier: Apache-2.0
// The listening socket of a server.
#pragma once

#include <string>
#include <vector>

#include "tools/scope/request.h"

namespace stickslip::scope {

/// The IPv4 addresses under which other machines may reach this one.
std::vector<std::string> addresses_of_this_machine();

/// Listens from construction on. Throws Failure with one line if the address does not
/// belong to this machine or the port is in use.
class Listener {
 public:
  explicit Listener(const ListenAddress& at);
  ~Listener();
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  int file() const { return file_; }
  /// With the port that the system chose for port 0.
  const ListenAddress& address() const { return address_; }

 private:
  int file_ = -1;
  ListenAddress address_;
};

}  // namespace stickslip::scope
