// SPDX-License-Identifier: Apache-2.0
// The signals that the daemon handles, as a file to poll.
#pragma once

#include <sys/signalfd.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <system_error>

namespace stickslip::daemon {

class Signals {
 public:
  /// `signals` must be blocked in every thread of the process.
  explicit Signals(const sigset_t& signals)
      : file_(signalfd(-1, &signals, SFD_CLOEXEC | SFD_NONBLOCK)) {
    if (file_ < 0) throw std::system_error(errno, std::generic_category(), "signalfd");
  }
  ~Signals() { ::close(file_); }
  Signals(const Signals&) = delete;
  Signals& operator=(const Signals&) = delete;

  int file() const { return file_; }

  /// The next pending signal; 0 if there is none.
  int next() const {
    signalfd_siginfo info{};
    if (::read(file_, &info, sizeof info) != sizeof info) return 0;
    return static_cast<int>(info.ssi_signo);
  }

 private:
  int file_ = -1;
};

}  // namespace stickslip::daemon
