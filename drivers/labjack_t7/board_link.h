// SPDX-License-Identifier: Apache-2.0
// Connections to one LabJack T7, and synchronous requests. Not for use while it streams, when
// requests and replies are asynchronous (see stream_session.h).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "config/bench.h"
#include "drivers/clock/host_clock.h"
#include "drivers/driver.h"
#include "drivers/labjack_t7/protocol.h"
#include "drivers/labjack_t7/tcp_connection.h"

namespace stickslip::drivers::labjack_t7 {

/// A connection with data that are not acknowledged in this time ends: "on" may arrive this late.
inline constexpr unsigned unacknowledged_ms = 500;

struct Problem {
  Outcome outcome = Outcome::temporary;
  std::string text;
};
/// None: success.
using Failure = std::optional<Problem>;

class BoardLink {
 public:
  BoardLink(const config::LabjackT7& settings, HostClock& clock)
      : settings_(settings), clock_(clock) {}

  /// Connects to the command port. The board is not identified yet.
  Failure connect();
  /// Reads the identity and checks it. `serial_at_start`: of the board with which the run began, 0:
  /// none.
  Failure identify(std::uint32_t serial_at_start);
  /// Connects to the stream port, anew: what an earlier stream left is dropped.
  Failure connect_stream();
  void close() noexcept;

  const Identity& identity() const { return identity_; }
  /// "LabJack T7 #470012345 at 192.168.1.207:502"; before it is identified without the number.
  const std::string& name() const { return name_; }
  TcpConnection& commands() { return commands_; }
  TcpConnection& stream() { return stream_; }
  /// Of the command connection.
  MessageReader& reader() { return reader_; }
  std::uint16_t next_transaction() { return ++transaction_; }

  /// Sends a request and waits for its reply, about a second at most. `purpose` completes "...
  /// cannot
  /// ...". Late replies to other requests are skipped. `data` is valid until the next request.
  Failure request(const char* purpose, const Feedback& feedback,
                  std::span<const std::uint8_t>& data);
  Failure request(const char* purpose, const Feedback& feedback);
  /// Of the latest request that received a reply.
  const Verdict& verdict() const { return verdict_; }

 private:
  Failure exchange(const Feedback& feedback, std::span<const std::uint8_t>& data);
  Failure broken(const std::string& why);

  const config::LabjackT7& settings_;
  HostClock& clock_;
  TcpConnection commands_;
  TcpConnection stream_;
  MessageReader reader_;
  Identity identity_;
  std::string name_;
  Verdict verdict_;
  std::uint16_t transaction_ = 0;
};

}  // namespace stickslip::drivers::labjack_t7
