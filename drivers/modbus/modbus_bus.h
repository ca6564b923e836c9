// SPDX-License-Identifier: Apache-2.0
// A Modbus connection, serial or TCP, shared by its units.
#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "config/bench.h"
#include "drivers/clock/host_clock.h"
#include "drivers/driver.h"
#include "drivers/modbus/adu.h"

namespace stickslip::drivers::modbus {

/// A unit as a user of the bus: its settings, and state kept for the bus. Belongs to one thread.
struct Caller {
  int unit = 1;
  std::int64_t timeout_ns = 500'000'000;
  std::int64_t pause_between_requests_ns = 0;
  std::int64_t pause_after_connect_ns = 0;

  /// A request whose reply may still arrive, on a serial line.
  struct Unanswered {
    Bytes request;
    std::int64_t lateness_ns = 0;  ///< longest time from its latest transmission to that reply
    std::int64_t until_ns = 0;
  };
  std::vector<Unanswered> unanswered;  ///< state of the bus
};

/// State of a request.
enum class Progress : std::uint8_t {
  answered,   ///< words, sent_ns and received_ns are set
  exception,  ///< exception of the unit: `exception`
  waiting,    ///< pending; call again with the same request
  silent,     ///< no reply within the time-out
  garbled,    ///< an invalid reply: `why`
  gone        ///< the connection is broken: `why`
};

struct Exchange {
  Progress progress = Progress::waiting;
  std::uint8_t exception = 0;
  std::vector<std::uint16_t> words;
  std::int64_t sent_ns = 0;
  std::int64_t received_ns = 0;
  std::uint64_t rejected = 0;  ///< invalid or unexpected replies
  std::string why;
};

/// Requests are sent one at a time, in order of arrival. A reply must match the request: same unit,
/// function and length, and on TCP the same transaction.
///
/// Replies on a serial line identify their request no further than that. A request without a valid
/// reply may be repeated at once: if the reply to the first is only late, it answers the second.
/// Only a different request with a reply of the same form waits, for two time-outs from the latest
/// transmission of the first (one, if an invalid reply arrived): a reply that is late by up to two
/// time-outs is not attributed to another request. Other units use the bus meanwhile.
class ModbusBus {
 public:
  /// Uses port and line settings of `unit`.
  ModbusBus(const config::ModbusUnit& unit, HostClock& clock);
  ~ModbusBus();
  ModbusBus(const ModbusBus&) = delete;
  ModbusBus& operator=(const ModbusBus&) = delete;

  /// Connects unless connected. After a failure, attempts are made with an increasing delay; calls
  /// in between return the same failure. `why` holds the message.
  Outcome connect(std::string& why);

  /// One step of a request: waits at most until `until_ns`, or with direction rts until the request
  /// is transmitted. While the result is `waiting`, the caller must call again with the same
  /// request, or leave.
  Exchange exchange(Caller& caller, std::span<const std::uint8_t> request, std::int64_t until_ns);

  /// Abandons the caller's request. On a serial line the next request waits until the reply would
  /// have arrived.
  void leave(const Caller& caller) noexcept;

  /// "/dev/ttyUSB0" or "lvdt.lab:502".
  const std::string& port() const { return settings_.port; }

 private:
  struct Connection;
  struct Pending {
    std::uint16_t transaction = 0;
    std::int64_t sent_ns = 0;
    std::int64_t due_ns = 0;
  };

  bool acquire(const Caller& caller, std::int64_t until_ns);
  void release(const Caller& caller) noexcept;
  Outcome connect_locked(std::string& why);
  Outcome refuse_connection(int error, const std::string& why);
  void disconnect() noexcept;
  int unread() const;  // received bytes not yet read
  std::int64_t may_send_ns(const Caller& caller) const;
  Exchange step(Caller& caller, std::span<const std::uint8_t> request, std::int64_t until_ns);
  bool send(const Caller& caller, std::span<const std::uint8_t> request, Exchange& so_far);
  bool send_serial(std::span<const std::uint8_t> request);
  Exchange await(const Caller& caller, std::span<const std::uint8_t> request, std::int64_t until_ns,
                 Exchange so_far);
  bool receive(const Caller& caller, std::span<const std::uint8_t> request, Exchange& so_far);
  bool evaluate(const Caller& caller, std::span<const std::uint8_t> request,
                std::span<const std::uint8_t> frame, Exchange& so_far);
  bool reject_foreign(std::uint8_t unit, Exchange& so_far);
  void settle(Caller& caller, std::span<const std::uint8_t> request, const Exchange& ended);
  void note_unanswered(Caller& caller, std::span<const std::uint8_t> request,
                       const Exchange& ended);
  Exchange broken(Exchange so_far, int error);

  config::ModbusUnit settings_;
  HostClock& clock_;

  std::mutex mutex_;  // guards the queue; its first caller owns all members below
  std::condition_variable moved_;
  std::deque<const Caller*> queue_;

  std::unique_ptr<Connection> connection_;
  std::optional<Pending> pending_;
  std::uint16_t transaction_ = 0;
  std::int64_t connected_ns_ = 0;
  std::int64_t last_traffic_ns_ = 0;
  std::array<std::int64_t, 256> late_until_ns_{};  // by unit: until then a late reply may arrive
  std::int64_t next_attempt_ns_ = 0;
  std::int64_t retry_delay_ns_ = 0;
  Outcome last_failure_ = Outcome::lost;
  std::string last_why_;
};

}  // namespace stickslip::drivers::modbus
