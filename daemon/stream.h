// The way from the loop to one consumer: a ring that the loop never waits on, a thread that cuts
// blocks from it, a sink that takes them, and an account that says where every frame went. The
// publisher and the recorder are two of these; neither can delay the other or the loop.
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

/// What became of something that was put into a sink.
enum class Put : std::uint8_t { done, encode_error, write_error };

/// A message that is neither a frame nor made from one: status, events. Already encoded.
struct Message {
  std::string channel;
  std::int64_t time_us = 0;  ///< since the epoch
  std::vector<std::uint8_t> bytes;
};

/// Where a stream ends: the network, a log, or a test. Called by one thread at a time.
class Sink {
 public:
  Sink() = default;
  Sink(const Sink&) = delete;
  Sink& operator=(const Sink&) = delete;
  virtual ~Sink() = default;

  /// All of `block` (never empty) or nothing.
  virtual Put put_block(std::span<const Sample> block) = 0;
  /// What the observer believed after some frame of the block before.
  virtual Put put_estimate(const Estimate& estimate) = 0;
  virtual Put put_message(const Message& message) = 0;
  /// Whether all that was put since the last time has really left. A disk takes what is put into a
  /// buffer first and may refuse it only here.
  virtual bool settle() { return true; }
  /// Whether it would rather settle now than when the period is over.
  virtual bool wants_to_settle() const { return false; }
  /// The last block has been put: what was held back for a later one is due. `settle` follows.
  virtual void finish() {}
};

struct StreamSettings {
  std::size_t frames_per_block = 10;
  std::size_t ring_frames = 16384;
  std::chrono::nanoseconds poll =
      std::chrono::milliseconds(2);  ///< how often an empty ring is looked at
  std::chrono::nanoseconds longest_wait =
      std::chrono::milliseconds(100);  ///< of a frame for its block to fill
  std::chrono::nanoseconds settle_period = std::chrono::milliseconds(200);  ///< between settlements
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

  /// Loop only, before the sample that it belongs to: what the observer believed after it. One that
  /// finds no room is dropped and counted as a lost message.
  void offer(const NumberedEstimate& estimate);

  /// Loop only: whether the next offer will be taken. For sources that can wait.
  bool has_room() const { return ring_.has_room() && estimates_.has_room(); }

  /// Any thread but the loop's. A message that finds no room is dropped and counted.
  void send(Message message);

  void start();

  /// After the last offer: waits until all has been put, for `patience` at most; what is still
  /// waiting then is lost to shutdown. Afterwards no thread runs and `send` puts at once.
  void finish(std::chrono::nanoseconds patience);

  /// Whether frames are being lost: something was since the last settlement that worked. Any
  /// thread.
  bool failing() const { return failing_.load(std::memory_order_relaxed); }

  /// Messages and estimates that found no room or were refused.
  std::uint64_t lost_messages() const { return lost_messages_.load(std::memory_order_relaxed); }

 private:
  void run();
  bool take_samples();
  void put_estimates(std::uint64_t up_to_number);
  void lose_waiting();
  bool put_messages();
  std::optional<Message> next_message();
  void put_block();
  void settle();

  Sink& sink_;
  Account& account_;
  StreamSettings settings_;
  Ring<Sample> ring_;
  Ring<NumberedEstimate> estimates_;
  std::mutex messages_lock_;  // neither side of this one is the loop
  std::deque<Message> messages_;
  std::vector<Sample> block_;
  std::uint64_t unsettled_ = 0;  // frames that were put and may still be refused
  std::chrono::steady_clock::time_point settled_;
  std::chrono::steady_clock::time_point block_begun_;
  std::atomic<bool> failing_{false};
  std::atomic<bool> draining_{false};
  std::atomic<bool> abandoned_{false};
  std::atomic<bool> ended_{false};
  std::atomic<std::uint64_t> lost_messages_{0};
  std::thread thread_;
};

}  // namespace stickslip::daemon
