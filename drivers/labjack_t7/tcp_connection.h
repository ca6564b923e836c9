// SPDX-License-Identifier: Apache-2.0
// A TCP connection that never blocks once it is open.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace stickslip::drivers::labjack_t7 {

class TcpConnection {
 public:
  TcpConnection() = default;
  ~TcpConnection() { close(); }
  TcpConnection(const TcpConnection&) = delete;
  TcpConnection& operator=(const TcpConnection&) = delete;

  /// Waits about a second at most for each address of the host. Empty: connected; else why not. The
  /// connection ends if sent data are not acknowledged within `unacknowledged_ms`, so that no old
  /// command arrives later than that.
  std::string open(const std::string& host, int port, unsigned unacknowledged_ms);
  void close() noexcept;
  bool is_open() const { return file_ >= 0; }
  int file() const { return file_; }

  enum class Sent : std::uint8_t { all, none, broken };
  Sent send(std::span<const std::uint8_t> bytes) const;

  enum class Received : std::uint8_t { bytes, nothing, ended };
  Received receive(std::span<std::uint8_t> space, std::size_t& received) const;
  /// Waits until something can be received, or the connection has ended. False: neither in time.
  bool wait(int timeout_ms) const;

 private:
  int file_ = -1;
};

}  // namespace stickslip::drivers::labjack_t7
