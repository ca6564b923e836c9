// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/listener.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "physics/failure.h"

namespace stickslip::scope {

namespace {

constexpr int max_unaccepted = 512;

struct SocketAddress {
  sockaddr_storage storage{};
  socklen_t size = 0;
};

SocketAddress socket_address(const ListenAddress& at) {
  SocketAddress out;
  auto& four = reinterpret_cast<sockaddr_in&>(out.storage);
  if (inet_pton(AF_INET, at.address.c_str(), &four.sin_addr) == 1) {
    four.sin_family = AF_INET;
    four.sin_port = htons(at.port);
    out.size = sizeof(sockaddr_in);
    return out;
  }
  auto& six = reinterpret_cast<sockaddr_in6&>(out.storage);
  if (inet_pton(AF_INET6, at.address.c_str(), &six.sin6_addr) != 1) {
    throw Failure(at.address + " is not a numeric address");
  }
  six.sin6_family = AF_INET6;
  six.sin6_port = htons(at.port);
  out.size = sizeof(sockaddr_in6);
  return out;
}

std::uint16_t port_of(int file) {
  sockaddr_storage storage{};
  socklen_t size = sizeof storage;
  getsockname(file, reinterpret_cast<sockaddr*>(&storage), &size);
  return ntohs(storage.ss_family == AF_INET6
                   ? reinterpret_cast<const sockaddr_in6&>(storage).sin6_port
                   : reinterpret_cast<const sockaddr_in&>(storage).sin_port);
}

std::string reason_for(int error) {
  if (error == EADDRINUSE) {
    return "another program is listening there; --listen ADDRESS:0 uses any free port";
  }
  if (error == EADDRNOTAVAIL) return "this machine has no such address (ip address lists them)";
  if (error == EACCES) return "ports below 1024 need root";
  return std::strerror(error);
}

}  // namespace

std::vector<std::string> addresses_of_this_machine() {
  std::vector<std::string> out;
  ifaddrs* first = nullptr;
  if (getifaddrs(&first) != 0) return out;
  for (const ifaddrs* one = first; one != nullptr; one = one->ifa_next) {
    const bool up = (one->ifa_flags & IFF_UP) != 0;
    if (!up || one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET) continue;
    std::array<char, INET_ADDRSTRLEN> text{};
    const auto& four = reinterpret_cast<const sockaddr_in&>(*one->ifa_addr);
    inet_ntop(AF_INET, &four.sin_addr, text.data(), text.size());
    if (!is_loopback(text.data())) out.emplace_back(text.data());
  }
  freeifaddrs(first);
  return out;
}

Listener::Listener(const ListenAddress& at) : address_(at) {
  const SocketAddress where = socket_address(at);
  file_ = socket(where.storage.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const int yes = 1;
  // A restarted server can bind its port while old connections are in TIME_WAIT.
  if (file_ < 0 || setsockopt(file_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) != 0 ||
      bind(file_, reinterpret_cast<const sockaddr*>(&where.storage), where.size) != 0 ||
      listen(file_, max_unaccepted) != 0) {
    const int error = errno;
    if (file_ >= 0) close(file_);
    throw Failure("cannot listen at " + text_of(at) + ": " + reason_for(error));
  }
  address_.port = port_of(file_);
}

Listener::~Listener() { close(file_); }

}  // namespace stickslip::scope
