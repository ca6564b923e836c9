// SPDX-License-Identifier: Apache-2.0
// The bounded queue of messages to one client.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "tools/scope/message.h"

namespace stickslip::scope {

/// Messages queued for one client. A client that is too slow loses telemetry: all that is queued
/// and all that arrives until it reads again, so that it resumes at the present; it is sent the
/// number of lost messages. State that a page must know is kept.
class Backlog {
 public:
  using Clock = std::chrono::steady_clock;

  /// `max_bytes`: capacity, without the greeting.
  explicit Backlog(std::size_t max_bytes) : max_bytes_(max_bytes) {}

  /// The first messages; not counted, since they are shared by all clients.
  void greet(std::vector<SharedMessage> messages);

  /// False if the messages that must be kept exceed the capacity: the client has to be closed.
  bool add(const SharedMessage& message, Clock::time_point now);

  /// The next message to send; null if there is none.
  SharedMessage take();

  bool empty() const { return greeting_.empty() && waiting_.empty() && lost_ == 0; }
  std::size_t bytes() const { return bytes_; }
  /// Messages lost since the start.
  std::uint64_t lost() const { return lost_in_all_; }

  /// Time since this client began to lose messages without catching up.
  Clock::duration losing_for(Clock::time_point now) const;

 private:
  void lose_telemetry(Clock::time_point now);

  std::size_t max_bytes_;
  std::deque<SharedMessage> greeting_;
  std::deque<SharedMessage> waiting_;
  std::size_t bytes_ = 0;   ///< of `waiting_`
  std::uint64_t lost_ = 0;  ///< not yet reported to the client
  std::uint64_t lost_in_all_ = 0;
  std::optional<Clock::time_point> losing_since_;
};

}  // namespace stickslip::scope
