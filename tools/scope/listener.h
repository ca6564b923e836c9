// The socket that a server listens at.
#pragma once

#include "tools/scope/request.h"

namespace stickslip::scope {

/// Listens from its making on. Throws std::runtime_error, in one line, where the address is not
/// this machine's or the port is taken.
class Listener {
 public:
  explicit Listener(const ListenAddress& at);
  ~Listener();
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  int file() const { return file_; }
  /// With the port that the system chose where any was asked for.
  const ListenAddress& address() const { return address_; }

 private:
  int file_ = -1;
  ListenAddress address_;
};

}  // namespace stickslip::scope
