// SPDX-License-Identifier: Apache-2.0
#include "tools/telemetry/lcm_packets.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <mutex>
#include <thread>

#include "config/lcm_url.h"
#include "physics/failure.h"
#include "tools/telemetry/lcm_client.h"

namespace stickslip::telemetry {

namespace {

constexpr std::uint32_t short_magic = 0x4C433032;     // "LC02"
constexpr std::uint32_t fragment_magic = 0x4C433033;  // "LC03"
constexpr std::size_t short_header = 8;
constexpr std::size_t fragment_header = 20;
constexpr int default_receive_buffer_bytes = 8 << 20;
constexpr std::size_t max_waiting_bytes = std::size_t{64} << 20U;

std::uint32_t big_endian(std::span<const std::uint8_t> bytes, std::size_t at, std::size_t size) {
  std::uint32_t out = 0;
  for (const std::uint8_t byte : bytes.subspan(at, size)) out = out << 8U | byte;
  return out;
}

/// The name that ends with a zero at the beginning of `bytes`, which is shortened by it.
std::optional<std::string> cut_name(std::span<const std::uint8_t>& bytes) {
  const auto end = std::find(bytes.begin(), bytes.end(), std::uint8_t{0});
  if (end == bytes.end()) return std::nullopt;
  std::string name(bytes.begin(), end);
  bytes = bytes.subspan(name.size() + 1);
  return name;
}

double unix_ms() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration<double, std::milli>(now).count();
}

std::string text_of(const sockaddr_in& from) {
  std::array<char, INET_ADDRSTRLEN> text{};
  inet_ntop(AF_INET, &from.sin_addr, text.data(), text.size());
  std::string out(text.data());
  out += ':';
  return out.append(std::to_string(ntohs(from.sin_port)));
}

/// A socket that has joined the group; -1 with errno if it cannot.
int joined_socket(const config::LcmUrl& url) {
  const int file = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (file < 0) return -1;
  const int yes = 1;
  const int wanted =
      url.receive_buffer_bytes > 0 ? url.receive_buffer_bytes : default_receive_buffer_bytes;
  setsockopt(file, SOL_SOCKET, SO_RCVBUF, &wanted, sizeof wanted);  // what the host allows
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_port = htons(static_cast<std::uint16_t>(std::stoi(url.port)));
  ip_mreq group{};
  inet_pton(AF_INET, url.address.c_str(), &group.imr_multiaddr);
  at.sin_addr = group.imr_multiaddr;
  if (setsockopt(file, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) != 0 ||
      setsockopt(file, SOL_SOCKET, SO_REUSEPORT, &yes, sizeof yes) != 0 ||
      bind(file, reinterpret_cast<const sockaddr*>(&at), sizeof at) != 0 ||
      setsockopt(file, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group) != 0) {
    const int error = errno;
    close(file);
    errno = error;
    return -1;
  }
  return file;
}

}  // namespace

std::optional<LcmMessage> PacketAssembler::take(std::span<const std::uint8_t> packet,
                                                const std::string& sender) {
  const std::uint32_t magic = packet.size() < short_header ? 0 : big_endian(packet, 0, 4);
  std::optional<LcmMessage> out;
  if (magic == fragment_magic && packet.size() >= fragment_header) {
    return take_fragment(packet, sender);
  }
  std::span<const std::uint8_t> rest = packet.subspan(std::min(short_header, packet.size()));
  const auto channel = magic == short_magic ? cut_name(rest) : std::nullopt;
  if (!channel) {
    ++malformed_;
    return out;
  }
  out.emplace(LcmMessage{sender, *channel, {rest.begin(), rest.end()}, 0.0});
  return out;
}

std::optional<LcmMessage> PacketAssembler::take_fragment(std::span<const std::uint8_t> packet,
                                                         const std::string& sender) {
  const std::uint32_t number = big_endian(packet, 4, 4);
  const std::size_t size = big_endian(packet, 8, 4);
  const std::size_t offset = big_endian(packet, 12, 4);
  const std::uint32_t index = big_endian(packet, 16, 2);
  const std::uint32_t count = big_endian(packet, 18, 2);
  std::span<const std::uint8_t> data = packet.subspan(fragment_header);
  const auto channel = index == 0 ? cut_name(data) : std::string();
  const bool sound = channel && index < count && size <= max_message_bytes && offset <= size &&
                     data.size() <= size - offset;
  const bool room = incomplete_.contains(sender) || incomplete_.size() < max_senders;
  if (!sound || !room) {
    ++malformed_;
    return std::nullopt;
  }
  Parts& parts = incomplete_[sender];
  if (parts.number != number || parts.bytes.size() != size || parts.missing.empty()) {
    parts = Parts{number, {}, {}, std::vector<std::uint8_t>(size)};
    for (std::uint32_t i = 0; i < count; ++i) parts.missing.insert(parts.missing.end(), i);
  }
  if (index == 0) parts.channel = *channel;
  std::copy(data.begin(), data.end(), parts.bytes.begin() + static_cast<std::ptrdiff_t>(offset));
  parts.missing.erase(index);
  if (!parts.missing.empty()) return std::nullopt;
  std::optional<LcmMessage> out(
      LcmMessage{sender, std::move(parts.channel), std::move(parts.bytes), 0.0});
  incomplete_.erase(sender);
  return out;
}

class LcmReceiver::Thread {
 public:
  explicit Thread(int socket_file)
      : socket_(socket_file),
        waiting_file_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
        end_file_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    if (waiting_file_ < 0 || end_file_ < 0) throw Failure("the system has no more files");
    thread_ = std::thread([this] { run(); });
  }
  ~Thread() {
    signal(end_file_);
    thread_.join();
    for (const int file : {socket_, waiting_file_, end_file_}) close(file);
  }
  Thread(const Thread&) = delete;
  Thread& operator=(const Thread&) = delete;

  int file() const { return waiting_file_; }

  std::vector<LcmMessage> take() {
    const std::lock_guard lock(mutex_);
    std::uint64_t count = 0;
    [[maybe_unused]] const ssize_t size = read(waiting_file_, &count, sizeof count);
    waiting_bytes_ = 0;
    return std::exchange(waiting_, {});
  }

 private:
  static void signal(int file) {
    const std::uint64_t one = 1;
    [[maybe_unused]] const ssize_t size = write(file, &one, sizeof one);
  }

  void run() {
    std::array<pollfd, 2> files = {{{socket_, POLLIN, 0}, {end_file_, POLLIN, 0}}};
    std::vector<std::uint8_t> packet(1U << 16U);
    while (files[1].revents == 0) {
      sockaddr_in from{};
      socklen_t from_size = sizeof from;
      const ssize_t size = recvfrom(socket_, packet.data(), packet.size(), 0,
                                    reinterpret_cast<sockaddr*>(&from), &from_size);
      if (size < 0) {
        poll(files.data(), files.size(), -1);
      } else if (auto message = assembler_.take(
                     std::span(packet).first(static_cast<std::size_t>(size)), text_of(from))) {
        keep(std::move(*message));
      }
    }
  }

  // A server that hangs loses messages as it would in the kernel.
  void keep(LcmMessage message) {
    message.received_unix_ms = unix_ms();
    const std::lock_guard lock(mutex_);
    if (waiting_bytes_ + message.bytes.size() > max_waiting_bytes) return;
    waiting_bytes_ += message.bytes.size();
    waiting_.push_back(std::move(message));
    signal(waiting_file_);
  }

  int socket_;
  int waiting_file_;
  int end_file_;
  PacketAssembler assembler_;
  std::mutex mutex_;
  std::vector<LcmMessage> waiting_;
  std::size_t waiting_bytes_ = 0;
  std::thread thread_;
};

LcmReceiver::LcmReceiver(const std::string& url) {
  const int file = joined_socket(config::parse_lcm_url(url));
  if (file < 0) {
    throw_lcm_error(std::string("does not receive at ") + url + " (" + std::strerror(errno) + ")");
  }
  thread_ = std::make_unique<Thread>(file);
}
LcmReceiver::~LcmReceiver() = default;
int LcmReceiver::file() const { return thread_->file(); }
std::vector<LcmMessage> LcmReceiver::take() { return thread_->take(); }

}  // namespace stickslip::telemetry
