// SPDX-License-Identifier: Apache-2.0
#include "tools/scope/backlog.h"

#include <algorithm>

#include "tools/scope/wire.h"

namespace stickslip::scope {

void Backlog::greet(std::vector<SharedMessage> messages) {
  greeting_.insert(greeting_.end(), messages.begin(), messages.end());
}

bool Backlog::add(const SharedMessage& message, Clock::time_point now) {
  waiting_.push_back(message);
  bytes_ += message->size();
  // A client that is behind gets no telemetry that would be old when it reads again.
  if (lost_ > 0 || bytes_ > max_bytes_) lose_telemetry(now);
  return bytes_ <= max_bytes_;
}

void Backlog::lose_telemetry(Clock::time_point now) {
  const auto lost = std::erase_if(
      waiting_, [](const SharedMessage& waiting) { return waiting->keep() == Keep::may_be_lost; });
  if (lost == 0) return;
  lost_ += lost;
  lost_in_all_ += lost;
  if (!losing_since_) losing_since_ = now;
  bytes_ = 0;
  for (const SharedMessage& waiting : waiting_) bytes_ += waiting->size();
}

SharedMessage Backlog::take() {
  if (!greeting_.empty()) {
    SharedMessage next = greeting_.front();
    greeting_.pop_front();
    return next;
  }
  if (lost_ > 0) {
    const std::uint64_t lost = lost_;
    lost_ = 0;
    return shared_message(encode_dropped(lost));
  }
  if (waiting_.empty()) {
    losing_since_.reset();
    return nullptr;
  }
  SharedMessage next = waiting_.front();
  waiting_.pop_front();
  bytes_ -= next->size();
  return next;
}

Backlog::Clock::duration Backlog::losing_for(Clock::time_point now) const {
  return losing_since_ ? now - *losing_since_ : Clock::duration::zero();
}

}  // namespace stickslip::scope
