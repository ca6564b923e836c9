// SPDX-License-Identifier: Apache-2.0
// The path from the loop to one consumer: a ring, a thread that cuts blocks from it, a sink that
// takes them, and an account of every frame. Publisher and recorder are two of these; neither can
// delay the other or the loop.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "daemon/ledger.h"
#include "daemon/ring.h"
#include "daemon/sample.h"

namespace stickslip::daemon {

enum class WriteResult : std::uint8_t { ok, encode_error, write_error };

/// An encoded message that is not made from frames: status, events.
struct Message {
  std::string channel;
  std::int64_t time_us = 0;  ///< since the epoch
  std::vector<std::uint8_t> bytes;
};

/// End of a stream: the network, a log, or a test. Called by one thread at a time.
class Sink {
 public:
  Sink() = default;
  Sink(const Sink&) = delete;
  Sink& operator=(const Sink&) = delete;
  virtual ~Sink() = default;

  /// All of `block` (never empty) or nothing.
  virtual WriteResult write_block(std::span<const Sample> block) = 0;
  /// The estimate after a frame of the previous block.
  virtual WriteResult write_estimate(const Estimate& estimate) = 0;
  virtual WriteResult write_message(const Message& message) = 0;
  /// True if everything written since the last flush has really left. A disk buffers what is
  /// written, and may refuse it only here.
  virtual bool flush() { return true; }
  /// True if the sink wants to be flushed before the period is over.
  virtual bool wants_flush() const { return false; }
  /// After the last block: writes what was held back. `flush` follows.
  virtual void finish() {}
};

struct StreamSettings {
  std::size_t frames_per_block = 10;
  std::size_t ring_frames = 16384;
  std::chrono::nanoseconds poll = std::chrono::milliseconds(2);  ///< period at which an empty ring
                                                                 ///< is polled
  std::chrono::nanoseconds longest_wait =
      std::chrono::milliseconds(100);  ///< of a frame for its block to fill
  std::chrono::nanoseconds flush_period = std::chrono::milliseconds(200);
};

class Stream {
 public:
  /// `sink` and `account` must outlive the stream. Enables the account.
  Stream(Sink& sink, Account& account, const StreamSettings& settings);
  ~Stream();
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  /// Loop only. Takes the sample, or counts it as lost because the ring is full. Does not wait,
  /// lock or allocate.
  void offer(const Sample& sample);

  /// Loop only, before the sample that it belongs to. An estimate that finds its ring full is
  /// dropped and counted as a lost message.
  void offer(const NumberedEstimate& estimate);

  /// Loop only: true if the next offer would be lost. For sources that can wait.
  bool full() const { return ring_.full() || estimates_.full(); }

  /// Any thread but the loop's. A message that finds the queue full is dropped and counted.
  void send(Message message);

  void start();

  /// After the last offer: waits until everything is written, for `timeout` at most; the rest is
  /// lost to shutdown. Afterwards no thread runs, and `send` writes directly.
  void finish(std::chrono::nanoseconds timeout);

  /// Any thread: true from a loss of frames to a flush of frames without one.
  bool failing() const { return failing_.load(std::memory_order_relaxed); }

  /// Messages and estimates that were dropped or refused.
  std::uint64_t lost_messages() const { return lost_messages_.load(std::memory_order_relaxed); }

 private:
  void run();
  void abandon();
  bool take_samples();
  void write_estimates(std::uint64_t up_to_number);
  void discard_rings();
  bool write_messages();
  std::optional<Message> next_message();
  void write_block();
  void flush();
  void count_lost_message() { lost_messages_.fetch_add(1, std::memory_order_relaxed); }

  Sink& sink_;
  Account& account_;
  StreamSettings settings_;
  Ring<Sample> ring_;
  Ring<NumberedEstimate> estimates_;
  std::mutex messages_lock_;  // never taken by the loop
  std::deque<Message> messages_;
  std::vector<Sample> block_;
  std::uint64_t unflushed_ = 0;  // frames that were written and may still be refused
  bool refused_ = false;         // a block since the last flush
  std::chrono::steady_clock::time_point flushed_at_;
  std::chrono::steady_clock::time_point block_start_;
  std::atomic<bool> failing_{false};
  std::atomic<bool> draining_{false};
  std::atomic<bool> abandoned_{false};
  std::atomic<bool> ended_{false};
  std::atomic<std::uint64_t> lost_messages_{0};
  std::thread thread_;
};

}  // namespace stickslip::daemon
