// One connection, a serial line or a TCP one, and the units that share it.
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
#include "drivers/driver.h"
#include "drivers/host_clock.h"
#include "drivers/modbus/adu.h"

namespace stickslip::drivers::modbus {

/// Who asks: what the bus has to know of a unit, and what it remembers of it. Belongs to one
/// thread.
struct Caller {
  int unit = 1;
  std::int64_t timeout_ns = 500'000'000;
  std::int64_t pause_between_requests_ns = 0;
  std::int64_t pause_after_connect_ns = 0;

  /// The bus's own: a late reply may come until then, which the next request must not take for its
  /// own.
  std::int64_t quiet_until_ns = 0;
  bool was_silent = false;
};

/// How far a request has got.
enum class Progress : std::uint8_t {
  answered,   ///< words, sent_ns and received_ns are set
  exception,  ///< the unit refuses: `exception`
  waiting,    ///< not yet; ask again with the same request
  silent,     ///< no answer within the unit's time-out
  garbled,    ///< something came that was not believed: `why`
  gone        ///< the connection itself is broken: `why`
};

struct Exchange {
  Progress progress = Progress::waiting;
  std::uint8_t exception = 0;
  std::vector<std::uint16_t> words;
  std::int64_t sent_ns = 0;
  std::int64_t received_ns = 0;
  std::uint64_t rejected = 0;  ///< replies that were not believed or belonged to nobody
  std::string why;
};

/// Requests go one at a time, in the order in which they were asked for. A reply counts only if it
/// is the one to the request: same unit, function, length, on TCP the same transaction.
///
/// A serial line's replies do not say which request they answer. After a unit was silent its next
/// request waits until a late reply would have come (another time-out), and the one after an answer
/// again, so that a reply that is late by up to two time-outs is thrown away and not taken for
/// another one's. Other units use the bus meanwhile.
class ModbusBus {
 public:
  /// Port and line settings are those of `its`.
  ModbusBus(const config::ModbusUnit& its, HostClock& clock);
  ~ModbusBus();
  ModbusBus(const ModbusBus&) = delete;
  ModbusBus& operator=(const ModbusBus&) = delete;

  /// Connects unless it is connected. After a failure it is tried again with growing patience, and
  /// the calls in between answer with the same failure. The message is valid until the caller's
  /// next call: it is kept in `why`.
  Outcome connect(std::string& why);

  /// One step of a request: waits at most until `until_ns`. While the answer is `waiting`, the
  /// caller has to ask again with the same request, or leave.
  Exchange exchange(Caller& caller, std::span<const std::uint8_t> request, std::int64_t until_ns);

  /// The caller is not interested any more in what it has asked for. On a serial line the next
  /// request waits until the answer would have come.
  void leave(const Caller& caller) noexcept;

  /// "/dev/ttyUSB0" or "lvdt.lab:502".
  const std::string& where() const { return where_; }

 private:
  struct Connection;
  struct UnderWay {
    std::uint16_t transaction = 0;
    std::int64_t sent_ns = 0;
    std::int64_t due_ns = 0;
  };

  bool acquire(const Caller& caller, std::int64_t until_ns);
  void release(const Caller& caller) noexcept;
  Outcome connect_as_owner(std::string& why);
  void disconnect() noexcept;
  int unread() const;  // bytes that came and were not looked at
  std::int64_t may_send_ns(const Caller& caller) const;
  Exchange step(Caller& caller, std::span<const std::uint8_t> request, std::int64_t until_ns);
  bool send(const Caller& caller, std::span<const std::uint8_t> request, Exchange& so_far);
  Exchange await(std::span<const std::uint8_t> request, std::int64_t until_ns, Exchange so_far);
  bool receive(std::span<const std::uint8_t> request, Exchange& so_far);
  bool judge(std::span<const std::uint8_t> request, std::span<const std::uint8_t> frame,
             Exchange& so_far);
  void settle(Caller& caller, const Exchange& ended);
  Exchange broken(Exchange so_far, int error);

  config::ModbusUnit its_;
  std::string where_;
  HostClock& clock_;

  std::mutex mutex_;  // guards the queue; whoever stands first owns all that follows
  std::condition_variable moved_;
  std::deque<const Caller*> queue_;

  std::unique_ptr<Connection> connection_;
  std::optional<UnderWay> under_way_;
  std::uint16_t transaction_ = 0;
  std::int64_t connected_ns_ = 0;
  std::int64_t last_traffic_ns_ = 0;
  std::int64_t next_attempt_ns_ = 0;
  std::int64_t patience_ns_ = 0;
  Outcome last_failure_ = Outcome::lost;
  std::string last_why_;
};

}  // namespace stickslip::drivers::modbus
