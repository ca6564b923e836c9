// A Modbus connection, serial or TCP, shared by its units.
#pragma once

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

  /// State of the bus: until then a late reply may arrive, which must not be matched with the next
  /// request.
  std::int64_t quiet_until_ns = 0;
  bool was_silent = false;
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
/// Replies on a serial line do not identify their request. After a time-out of a unit, its next
/// request waits until a late reply would have arrived (another time-out), and so does the one
/// after the next reply: a reply that is late by up to two time-outs is discarded and not
/// attributed to another request. Other units use the bus meanwhile.
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

  /// One step of a request: waits at most until `until_ns`. While the result is `waiting`, the
  /// caller must call again with the same request, or leave.
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
  void disconnect() noexcept;
  int unread() const;  // received bytes not yet read
  std::int64_t may_send_ns(const Caller& caller) const;
  Exchange step(Caller& caller, std::span<const std::uint8_t> request, std::int64_t until_ns);
  bool send(const Caller& caller, std::span<const std::uint8_t> request, Exchange& so_far);
  Exchange await(std::span<const std::uint8_t> request, std::int64_t until_ns, Exchange so_far);
  bool receive(std::span<const std::uint8_t> request, Exchange& so_far);
  bool evaluate(std::span<const std::uint8_t> request, std::span<const std::uint8_t> frame,
                Exchange& so_far);
  void settle(Caller& caller, const Exchange& ended);
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
  std::int64_t next_attempt_ns_ = 0;
  std::int64_t retry_delay_ns_ = 0;
  Outcome last_failure_ = Outcome::lost;
  std::string last_why_;
};

}  // namespace stickslip::drivers::modbus
