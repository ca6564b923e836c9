// SPDX-License-Identifier: Apache-2.0
// Reads a gauge in a separate thread, reopens it after a loss, and hands its readings to the loop,
// which never waits for it.
#pragma once

#include <readerwriterqueue/readerwriterqueue.h>

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "drivers/gauge.h"

namespace stickslip::drivers {

/// Delay before a gauge is reopened that could not be opened, or was lost before its first reading.
/// Doubles from first to longest.
struct RetryDelay {
  std::int64_t first_ns = 100'000'000;
  std::int64_t longest_ns = 5'000'000'000;
};

/// open -> (latest, lost)* -> close. `open` and `close` are called by one thread; `latest` and
/// `drop_readings` by the loop, which may be another.
class GaugeReader {
 public:
  explicit GaugeReader(std::unique_ptr<Gauge> gauge, RetryDelay retry = {});
  ~GaugeReader();
  GaugeReader(const GaugeReader&) = delete;
  GaugeReader& operator=(const GaugeReader&) = delete;

  const Gauge& gauge() const { return *gauge_; }

  /// With `insist`: opens the gauge, which may take seconds, and starts its thread, or returns the
  /// failure. Otherwise the thread opens it, and retries.
  Result open(bool insist);
  /// Ends the thread and closes the gauge.
  void close() noexcept;

  /// Latest reading of the input at or before a time on the host's clock; invalid if there is none
  /// since the gauge was opened, or if the gauge marks it as invalid. Times must not decrease from
  /// call to call: boards deliver scans in bursts, and a reading newer than a scan is kept for a
  /// later one. Neither waits nor allocates.
  Reading latest(std::size_t input, std::int64_t time_ns);

  /// A message while the gauge is lost, else null. Valid as long as this object. Neither waits nor
  /// allocates.
  const char* lost() const noexcept;

  /// That of the gauge as of the latest open that insisted.
  const std::string& remark() const { return remark_; }

  Signals signals() const noexcept { return gauge_->signals(); }

  /// Accumulated over all openings of the gauge. Any thread.
  GaugeLosses losses() const noexcept;

 private:
  enum class Condition : std::uint8_t { open, gone, needs_attention, unusable };
  struct Update {
    std::size_t input = 0;
    Reading reading;
  };

  void run();
  static Condition condition_after(Outcome outcome);
  bool read_until_lost();
  void wait(std::int64_t ns);
  void publish(std::size_t input, const Reading& reading);
  void publish_loss(Condition condition);
  void publish_losses();
  void keep_losses();

  std::unique_ptr<Gauge> gauge_;
  RetryDelay retry_;
  std::string remark_;
  std::array<std::string, 4> messages_;  // by Condition
  // Bounded, from the gauge's thread to the loop.
  moodycamel::ReaderWriterQueue<Update> updates_;
  std::vector<Reading> latest_;  // by input; of the loop's thread
  std::atomic<Condition> condition_{Condition::gone};
  std::atomic<std::uint64_t> missing_{0};
  std::atomic<std::uint64_t> rejected_{0};
  std::uint64_t missing_before_ = 0;  // of earlier openings; of the gauge's thread
  std::uint64_t rejected_before_ = 0;
  bool delivered_ = false;  // a reading since it was opened; of its thread
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ = false;  // under mutex_
  std::thread thread_;
};

}  // namespace stickslip::drivers
