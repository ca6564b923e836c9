// What is still to be sent to one client, bounded in bytes.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "tools/scope/message.h"

namespace stickslip::scope {

/// Messages on their way to one client. One that is too slow loses telemetry: all that waits, and
/// all that comes until it reads again, so that it is at the present then. It is told how much that
/// was. What a page must know is kept.
class Backlog {
 public:
  using Clock = std::chrono::steady_clock;

  /// `most_bytes`: what may wait, without the greeting.
  explicit Backlog(std::size_t most_bytes) : most_bytes_(most_bytes) {}

  /// What is sent first; it does not count, since it is shared and known.
  void greet(std::vector<SharedMessage> messages);

  /// Returns false where what must be kept alone is more than may wait: the client is past help.
  bool add(const SharedMessage& message, Clock::time_point now);

  /// The next message to send; null where nothing waits.
  SharedMessage take();

  bool empty() const { return greeting_.empty() && waiting_.empty() && lost_ == 0; }
  std::size_t bytes() const { return bytes_; }
  /// Messages lost since the start.
  std::uint64_t lost() const { return lost_in_all_; }

  /// For how long this client has been losing, without a moment at which all had been sent.
  Clock::duration losing_for(Clock::time_point now) const;

 private:
  void lose_telemetry(Clock::time_point now);

  std::size_t most_bytes_;
  std::deque<SharedMessage> greeting_;
  std::deque<SharedMessage> waiting_;
  std::size_t bytes_ = 0;   ///< of `waiting_`
  std::uint64_t lost_ = 0;  ///< and not yet told
  std::uint64_t lost_in_all_ = 0;
  std::optional<Clock::time_point> losing_since_;
};

}  // namespace stickslip::scope
