// SPDX-License-Identifier: Apache-2.0
#include "daemon/stream.h"

#include <utility>

namespace stickslip::daemon {
namespace {

using std::chrono::steady_clock;

constexpr std::size_t message_capacity = 1024;

Loss loss_of(WriteResult result) {
  return result == WriteResult::encode_error ? Loss::encode_error : Loss::write_error;
}

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
  if (!estimates_.push(estimate)) count_lost_message();
}

void Stream::send(Message message) {
  if (thread_.joinable()) {
    const std::lock_guard lock(messages_lock_);
    if (messages_.size() < message_capacity) {
      messages_.push_back(std::move(message));
      return;
    }
  } else if (sink_.write_message(message) == WriteResult::ok) {
    return;
  }
  count_lost_message();
}

void Stream::start() {
  thread_ = std::thread([this] { run(); });
}

void Stream::finish(std::chrono::nanoseconds timeout) {
  if (!thread_.joinable()) {
    discard_rings();  // the thread was never started
    return;
  }
  draining_.store(true, std::memory_order_release);
  const auto until = steady_clock::now() + timeout;
  while (!ended_.load(std::memory_order_acquire)) {
    if (steady_clock::now() >= until) abandoned_.store(true, std::memory_order_release);
    std::this_thread::sleep_for(std::chrono::microseconds(500));
  }
  thread_.join();
}

void Stream::run() {
  while (!abandoned_.load(std::memory_order_acquire)) {
    // Read before the ring, so that everything offered before the drain began is seen in the ring.
    const bool draining = draining_.load(std::memory_order_acquire);
    const bool busy = take_samples();
    if (write_messages() || busy) continue;
    if (draining) break;
    if (!block_.empty() && steady_clock::now() - block_start_ >= settings_.longest_wait) {
      write_block();
    }
    if (steady_clock::now() - flushed_at_ >= settings_.flush_period) flush();
    std::this_thread::sleep_for(settings_.poll);
  }
  if (abandoned_.load(std::memory_order_acquire)) {
    abandon();
  } else if (!block_.empty()) {
    write_block();
  }
  sink_.finish();
  flush();
  ended_.store(true, std::memory_order_release);
}

void Stream::abandon() {
  account_.lose(Loss::shutdown, block_.size());
  block_.clear();
  while (next_message()) count_lost_message();
  discard_rings();
}

void Stream::discard_rings() {
  for (; ring_.front() != nullptr; ring_.pop()) account_.lose(Loss::shutdown, 1);
  for (; estimates_.front() != nullptr; estimates_.pop()) count_lost_message();
}

// One block at most, so that messages and the end are checked in between.
bool Stream::take_samples() {
  bool any = false;
  while (const Sample* sample = ring_.front()) {
    if (block_.empty()) block_start_ = steady_clock::now();
    block_.push_back(*sample);
    ring_.pop();
    any = true;
    if (block_.size() == settings_.frames_per_block) {
      write_block();
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

bool Stream::write_messages() {
  bool any = false;
  while (const std::optional<Message> message = next_message()) {
    if (sink_.write_message(*message) != WriteResult::ok) count_lost_message();
    any = true;
  }
  return any;
}

void Stream::write_block() {
  const WriteResult result = sink_.write_block(block_);
  if (result == WriteResult::ok) {
    unflushed_ += block_.size();
  } else {
    account_.lose(loss_of(result), block_.size());
    refused_ = true;
    failing_.store(true, std::memory_order_relaxed);
  }
  write_estimates(block_.back().number);
  block_.clear();
  if (sink_.wants_flush() || steady_clock::now() - flushed_at_ >= settings_.flush_period) flush();
}

// Frames count as delivered only after a successful flush.
void Stream::flush() {
  flushed_at_ = steady_clock::now();
  const bool flushed = sink_.flush();
  if (flushed) {
    account_.deliver(unflushed_);
  } else {
    account_.lose(Loss::write_error, unflushed_);
  }
  const bool lossy = !flushed || refused_;
  if (lossy || unflushed_ > 0) failing_.store(lossy, std::memory_order_relaxed);
  refused_ = false;
  unflushed_ = 0;
}

// The estimates of the block just written; later ones wait for their own block.
void Stream::write_estimates(std::uint64_t up_to_number) {
  for (; const NumberedEstimate* next = estimates_.front(); estimates_.pop()) {
    if (next->number > up_to_number) return;
    if (sink_.write_estimate(next->estimate) != WriteResult::ok) count_lost_message();
  }
}

}  // namespace stickslip::daemon
