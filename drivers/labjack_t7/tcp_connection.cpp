// SPDX-License-Identifier: Apache-2.0
#include "drivers/labjack_t7/tcp_connection.h"

#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <memory>
#include <system_error>

namespace stickslip::drivers::labjack_t7 {

namespace {

constexpr int connect_timeout_ms = 1000;

std::string error_text(int error) {
  const std::string text = std::generic_category().message(error);
  const bool denied = error == EPERM || error == EACCES;
  return denied ? text + " (a systemd unit needs IPAddressAllow in hardware.conf)" : text;
}

/// 0, or an error.
int wait_for_connection(int file) {
  pollfd waiting{file, POLLOUT, 0};
  int ready = 0;
  do {
    ready = ::poll(&waiting, 1, connect_timeout_ms);
  } while (ready < 0 && errno == EINTR);
  if (ready < 0) return errno;
  if (ready == 0) return ETIMEDOUT;
  int error = 0;
  socklen_t size = sizeof error;
  return ::getsockopt(file, SOL_SOCKET, SO_ERROR, &error, &size) == 0 ? error : errno;
}

/// The connected socket, or -1 and an error.
int connected(const addrinfo& address, int& error) {
  const int file = ::socket(address.ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (file < 0) {
    error = errno;
    return -1;
  }
  error = ::connect(file, address.ai_addr, address.ai_addrlen) == 0 ? 0 : errno;
  if (error == EINPROGRESS) error = wait_for_connection(file);
  if (error == 0) return file;
  ::close(file);
  return -1;
}

}  // namespace

std::string TcpConnection::open(const std::string& host, int port, unsigned unacknowledged_ms) {
  close();
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int unknown = ::getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found);
  if (unknown != 0) return std::string("the name is unknown: ") + ::gai_strerror(unknown);
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> addresses(found, ::freeaddrinfo);
  int error = 0;
  for (const addrinfo* each = found; each != nullptr && file_ < 0; each = each->ai_next) {
    file_ = connected(*each, error);
  }
  if (file_ < 0) return error_text(error);
  const int on = 1;
  ::setsockopt(file_, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  ::setsockopt(file_, IPPROTO_TCP, TCP_USER_TIMEOUT, &unacknowledged_ms, sizeof unacknowledged_ms);
  return {};
}

void TcpConnection::close() noexcept {
  if (file_ >= 0) ::close(file_);
  file_ = -1;
}

TcpConnection::Sent TcpConnection::send(std::span<const std::uint8_t> bytes) const {
  const ssize_t sent = ::send(file_, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  if (sent < 0 && (errno == EAGAIN || errno == EINTR)) return Sent::none;
  // A part of a request would spoil all later ones.
  return sent == static_cast<ssize_t>(bytes.size()) ? Sent::all : Sent::broken;
}

TcpConnection::Received TcpConnection::receive(std::span<std::uint8_t> space,
                                               std::size_t& received) const {
  const ssize_t got = ::recv(file_, space.data(), space.size(), MSG_DONTWAIT);
  if (got < 0 && (errno == EAGAIN || errno == EINTR)) return Received::nothing;
  if (got <= 0) return Received::ended;
  received = static_cast<std::size_t>(got);
  return Received::bytes;
}

bool TcpConnection::wait(int timeout_ms) const {
  pollfd waiting{file_, POLLIN, 0};
  return ::poll(&waiting, 1, timeout_ms) > 0;
}

}  // namespace stickslip::drivers::labjack_t7
