#include "daemon/stream.h"

#include <utility>

namespace stickslip::daemon {
namespace {

constexpr std::size_t message_room = 1024;

Loss loss_of(Put put) { return put == Put::encode_error ? Loss::encode_error : Loss::write_error; }

}  // namespace

Stream::Stream(Sink& sink, Account& account, const StreamSettings& settings)
    : sink_(sink),
      account_(account),
      settings_(settings),
      ring_(settings.ring_frames),
      estimates_(settings.ring_frames / settings.frames_per_block + 2) {
  block_.reserve(settings_.frames_per_block);
  account_.enable();
}

Stream::~Stream() { finish(std::chrono::nanoseconds::zero()); }

void Stream::offer(const Sample& sample) {
  if (ring_.push(sample)) return;
  account_.lose(Loss::ring_full, 1);
  failing_.store(true, std::memory_order_relaxed);
}

void Stream::offer(const NumberedEstimate& estimate) {
  if (!estimates_.push(estimate)) lost_messages_.fetch_add(1, std::memory_order_relaxed);
}

void Stream::lose_waiting() {
  for (; ring_.front() != nullptr; ring_.pop()) account_.lose(Loss::shutdown, 1);
  for (; estimates_.front() != nullptr; estimates_.pop()) {
    lost_messages_.fetch_add(1, std::memory_order_relaxed);
  }
}

void Stream::send(Message message) {
  if (thread_.joinable()) {
    const std::lock_guard lock(messages_lock_);
    if (messages_.size() < message_room) {
      messages_.push_back(std::move(message));
      return;
    }
  } else if (sink_.put_message(message) == Put::done) {
    return;
  }
  lost_messages_.fetch_add(1, std::memory_order_relaxed);
}

void Stream::start() {
  thread_ = std::thread([this] { run(); });
}

void Stream::finish(std::chrono::nanoseconds patience) {
  if (!thread_.joinable()) {
    lose_waiting();  // never started: what was offered has nowhere to go
    return;
  }
  draining_.store(true, std::memory_order_release);
  const auto until = std::chrono::steady_clock::now() + patience;
  while (!ended_.load(std::memory_order_acquire)) {
    if (std::chrono::steady_clock::now() >= until)
      abandoned_.store(true, std::memory_order_release);
    std::this_thread::sleep_for(std::chrono::microseconds(500));
  }
  thread_.join();
}

void Stream::run() {
  while (!abandoned_.load(std::memory_order_acquire)) {
    // Read before the ring: what was offered before the drain began is then seen in the ring.
    const bool draining = draining_.load(std::memory_order_acquire);
    const bool busy = take_samples();
    if (put_messages() || busy) continue;
    if (draining) break;
    if (!block_.empty() &&
        std::chrono::steady_clock::now() - block_begun_ >= settings_.longest_wait) {
      put_block();
    }
    if (std::chrono::steady_clock::now() - settled_ >= settings_.settle_period) settle();
    std::this_thread::sleep_for(settings_.poll);
  }
  if (abandoned_.load(std::memory_order_acquire)) {
    account_.lose(Loss::shutdown, block_.size());
    block_.clear();
    while (next_message()) lost_messages_.fetch_add(1, std::memory_order_relaxed);
    lose_waiting();
  } else if (!block_.empty()) {
    put_block();
  }
  sink_.finish();
  settle();
  ended_.store(true, std::memory_order_release);
}

// At most one block, so that messages and the end are looked at in between.
bool Stream::take_samples() {
  bool any = false;
  while (const Sample* sample = ring_.front()) {
    if (block_.empty()) block_begun_ = std::chrono::steady_clock::now();
    block_.push_back(*sample);
    ring_.pop();
    any = true;
    if (block_.size() == settings_.frames_per_block) {
      put_block();
      break;
    }
  }
  return any;
}

std::optional<Message> Stream::next_message() {
  const std::lock_guard lock(messages_lock_);
  if (messages_.empty()) return std::nullopt;
  Message message = std::move(messages_.front());
  messages_.pop_front();
  return message;
}

bool Stream::put_messages() {
  bool any = false;
  while (const std::optional<Message> message = next_message()) {
    if (sink_.put_message(*message) != Put::done) {
      lost_messages_.fetch_add(1, std::memory_order_relaxed);
    }
    any = true;
  }
  return any;
}

void Stream::put_block() {
  const Put put = sink_.put_block(block_);
  if (put == Put::done) {
    unsettled_ += block_.size();
  } else {
    account_.lose(loss_of(put), block_.size());
    failing_.store(true, std::memory_order_relaxed);
  }
  put_estimates(block_.back().number);
  block_.clear();
  if (sink_.wants_to_settle() ||
      std::chrono::steady_clock::now() - settled_ >= settings_.settle_period) {
    settle();
  }
}

// Only what has left for good is delivered.
void Stream::settle() {
  settled_ = std::chrono::steady_clock::now();
  const bool settled = sink_.settle();
  if (settled) {
    account_.deliver(unsettled_);
  } else {
    account_.lose(Loss::write_error, unsettled_);
  }
  failing_.store(!settled, std::memory_order_relaxed);
  unsettled_ = 0;
}

// Those that belong to the block just put; a later one waits for its own.
void Stream::put_estimates(std::uint64_t up_to_number) {
  for (; const NumberedEstimate* next = estimates_.front(); estimates_.pop()) {
    if (next->number > up_to_number) return;
    if (sink_.put_estimate(next->estimate) != Put::done) {
      lost_messages_.fetch_add(1, std::memory_order_relaxed);
    }
  }
}

}  // namespace stickslip::daemon
