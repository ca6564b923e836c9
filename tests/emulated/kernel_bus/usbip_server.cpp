// SPDX-License-Identifier: Apache-2.0
#include "tests/emulated/kernel_bus/usbip_server.h"

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>

namespace stickslip::emulated {

namespace {

constexpr const char* controller = "/sys/devices/platform/vhci_hcd.0/";
constexpr std::size_t header_size = 48;
constexpr std::uint32_t submit = 1;
constexpr std::uint32_t unlink_request = 2;
constexpr std::uint32_t submitted = 3;
constexpr std::uint32_t unlinked = 4;
constexpr int full_speed = 2;

using Header = std::array<std::uint8_t, header_size>;

std::uint32_t get(const Header& header, std::size_t at) {
  return static_cast<std::uint32_t>(header[at] << 24U | header[at + 1] << 16U |
                                    header[at + 2] << 8U | header[at + 3]);
}

void put(Header& header, std::size_t at, std::uint32_t value) {
  for (std::size_t i = 0; i < 4; ++i) {
    header[at + i] = static_cast<std::uint8_t>(value >> (24U - 8U * i));
  }
}

bool receive(int socket, std::uint8_t* data, std::size_t size) {
  while (size > 0) {
    const ssize_t got = ::recv(socket, data, size, 0);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    data += got;
    size -= static_cast<std::size_t>(got);
  }
  return true;
}

bool send(int socket, const std::uint8_t* data, std::size_t size) {
  while (size > 0) {
    const ssize_t sent = ::send(socket, data, size, MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent <= 0) return false;
    data += sent;
    size -= static_cast<std::size_t>(sent);
  }
  return true;
}

void write_to_controller(const char* file, const std::string& words) {
  std::ofstream out(std::string(controller) + file);
  out << words << std::flush;
  if (!out) {
    throw std::runtime_error(std::string(controller) + file + " does not accept \"" + words + '"');
  }
}

UsbSetup setup_in(const Header& header) {
  const auto word = [&header](std::size_t at) {
    return static_cast<std::uint16_t>(header[at] | header[at + 1] << 8U);
  };
  return {header[40], header[41], word(42), word(44), word(46)};
}

/// A string descriptor in UTF-16.
Bytes string_descriptor(const std::string& text) {
  Bytes out = {static_cast<std::uint8_t>(2 + 2 * text.size()), 3};
  for (const char c : text) {
    out.push_back(static_cast<std::uint8_t>(c));
    out.push_back(0);
  }
  return out;
}

}  // namespace

bool UsbipServer::available() {
  return ::access((std::string(controller) + "attach").c_str(), W_OK) == 0;
}

void UsbipServer::plug() {
  unplug();
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    throw std::runtime_error(std::string("no socket pair: ") + std::strerror(errno));
  }
  device_.reset();
  hangs_ = has_unserved_request_ = false;
  socket_ = ends[1];
  constexpr int bus_and_device = 1 << 16 | 2;
  try {
    write_to_controller("attach", std::to_string(port_) + ' ' + std::to_string(ends[0]) + ' ' +
                                      std::to_string(bus_and_device) + ' ' +
                                      std::to_string(full_speed));
  } catch (...) {
    ::close(ends[0]);
    ::close(ends[1]);
    throw;
  }
  ::close(ends[0]);  // now held by the controller
  thread_ = std::thread([this] { serve(); });
}

void UsbipServer::unplug() {
  if (!thread_.joinable()) return;
  // Like unplugging the cable: the controller detects the closed connection.
  ::shutdown(socket_, SHUT_RDWR);
  thread_.join();
  ::close(socket_);
  socket_ = -1;
  waiting_.clear();
}

void UsbipServer::serve() {
  // Pending requests are polled, as a host does.
  for (;;) {
    bool any = false;
    for (const auto& [endpoint, requests] : waiting_) any = any || !requests.empty();
    if (!take(any ? poll_ms_ : 1000)) return;
    if (!hangs_) {
      serve_requests();
    } else if (!waiting_[0].empty() || !waiting_[0x80].empty()) {
      has_unserved_request_ = true;
    }
  }
}

/// Reads all pending requests; false if the connection is closed.
bool UsbipServer::take(int timeout_ms) {
  for (int wait_ms = timeout_ms;; wait_ms = 0) {
    pollfd poll_socket{socket_, POLLIN, 0};
    const int ready = ::poll(&poll_socket, 1, wait_ms);
    if (ready < 0 && errno != EINTR) return false;
    if (ready <= 0) return true;
    Header header{};
    if (!receive(socket_, header.data(), header.size())) return false;
    const std::uint32_t command = get(header, 0);
    Request request;
    request.number = get(header, 4);
    request.in = get(header, 12) == 1;
    request.endpoint = static_cast<std::uint8_t>(get(header, 16));
    if (command == submit) {
      request.length = get(header, 24);
      request.setup = setup_in(header);
      if (!request.in) {
        request.data.resize(request.length);
        if (!receive(socket_, request.data.data(), request.data.size())) return false;
      }
      const auto address = static_cast<std::uint8_t>(request.endpoint | (request.in ? 0x80 : 0));
      waiting_[address].push_back(std::move(request));
    } else if (command == unlink_request) {
      const std::uint32_t victim = get(header, 20);
      bool found = false;
      for (auto& [address, requests] : waiting_) {
        found =
            std::erase_if(requests,
                          [victim](const Request& each) { return each.number == victim; }) > 0 ||
            found;
      }
      Header out{};
      put(out, 0, unlinked);
      put(out, 4, request.number);
      // A request that was already answered cannot be cancelled.
      put(out, 20, found ? static_cast<std::uint32_t>(-ECONNRESET) : 0U);
      if (!send(socket_, out.data(), out.size())) return false;
    } else {
      return false;
    }
  }
}

void UsbipServer::serve_requests() {
  for (auto& [address, requests] : waiting_) {
    while (!requests.empty()) {
      const auto answer = try_request(requests.front());
      if (!answer) break;
      if (!reply(requests.front(), *answer)) return;
      requests.pop_front();
    }
  }
}

/// None: the device is not ready.
std::optional<UsbAnswer> UsbipServer::try_request(const Request& request) {
  UsbAnswer answer;
  if (request.endpoint == 0) {
    answer = control(request);
  } else if (request.in) {
    answer = device_.in(request.endpoint, request.length);
  } else {
    answer.status = device_.out(request.endpoint, request.data);
  }
  if (answer.status == UsbStatus::not_ready) return std::nullopt;
  return answer;
}

UsbAnswer UsbipServer::control(const Request& request) {
  const UsbSetup& setup = request.setup;
  constexpr std::uint8_t kind = 0x60;
  constexpr std::uint8_t recipient = 0x1F;
  const bool standard = (setup.request_type & kind) == 0;
  const bool of_interface = (setup.request_type & recipient) == 1;
  if (!standard || (of_interface && setup.request == 6)) {
    return device_.control(setup, request.data);
  }
  switch (setup.request) {
    case 0:  // GET_STATUS
      return {UsbStatus::ok, {0, 0}};
    case 1:  // CLEAR_FEATURE
      if ((setup.request_type & recipient) == 2) {
        device_.clear_halt(static_cast<std::uint8_t>(setup.index));
      }
      return {};
    case 6:
      return descriptor(setup);
    case 8:  // GET_CONFIGURATION
      return {UsbStatus::ok, {1}};
    case 3:   // SET_FEATURE
    case 5:   // SET_ADDRESS
    case 9:   // SET_CONFIGURATION
    case 11:  // SET_INTERFACE
      return {};
    default:
      return {UsbStatus::stall, {}};
  }
}

UsbAnswer UsbipServer::descriptor(const UsbSetup& setup) const {
  const auto index = static_cast<std::uint8_t>(setup.value & 0xFF);
  switch (setup.value >> 8) {
    case 1:
      return {UsbStatus::ok, device_.device_descriptor()};
    case 2:
      return {UsbStatus::ok, device_.configuration_descriptor()};
    case 3: {
      if (index == 0) return {UsbStatus::ok, {4, 3, 0x09, 0x04}};  // English
      const std::string text = device_.string(index);
      if (!text.empty()) return {UsbStatus::ok, string_descriptor(text)};
      return {UsbStatus::stall, {}};
    }
    default:
      return {UsbStatus::stall, {}};
  }
}

bool UsbipServer::reply(const Request& request, const UsbAnswer& answer) {
  const bool ok = answer.status == UsbStatus::ok;
  const std::size_t length = !ok ? 0U
                             : request.in
                                 ? std::min<std::size_t>(answer.bytes.size(), request.length)
                                 : request.data.size();
  Header out{};
  put(out, 0, submitted);
  put(out, 4, request.number);
  put(out, 20, ok ? 0U : static_cast<std::uint32_t>(-EPIPE));
  put(out, 24, static_cast<std::uint32_t>(length));
  if (!send(socket_, out.data(), out.size())) return false;
  return !ok || !request.in || send(socket_, answer.bytes.data(), length);
}

}  // namespace stickslip::emulated
