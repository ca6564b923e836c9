// Reads a gauge in a thread of its own, opens it again when it was lost, and keeps what it said for
// the loop, which never waits for it.
#pragma once

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
#include "drivers/ring.h"

namespace stickslip::drivers {

/// How long a gauge that cannot be opened is left alone, doubling from first to longest.
struct Patience {
  std::int64_t first_ns = 100'000'000;
  std::int64_t longest_ns = 5'000'000'000;
};

/// open -> (latest, lost)* -> close. `open` and `close` are called by one thread; `latest` and
/// `drop_readings` by the loop, which may be another.
class GaugeReader {
 public:
  explicit GaugeReader(std::unique_ptr<Gauge> gauge, Patience patience = {});
  ~GaugeReader();
  GaugeReader(const GaugeReader&) = delete;
  GaugeReader& operator=(const GaugeReader&) = delete;

  const Gauge& gauge() const { return *gauge_; }

  /// Opens the gauge and starts its thread. Where it cannot be opened: with `insist` no thread is
  /// started, and that is the answer; else the thread goes on trying, and the answer is ok.
  Result open(bool insist);
  /// Ends the thread and closes the gauge.
  void close() noexcept;

  /// What the input said last at or before that time on the host's clock; not valid where it has
  /// said nothing, or nothing that it believes itself. Neither waits nor allocates.
  Reading latest(std::size_t input, std::int64_t time_ns);

  /// A sentence, while the gauge is not there; null while it is. Lives as long as this object.
  /// Neither waits nor allocates.
  const char* lost() const noexcept;

  Signals signals() const noexcept { return gauge_->signals(); }

  /// Of the gauge, and readings that found no room because the loop did not look.
  GaugeLosses losses() const;

 private:
  enum class Condition : std::uint8_t { here, gone, needs_attention, beyond_help };
  /// Boards hand their scans over in bursts: a reading that is newer than a scan is kept for the
  /// next, and one before it is used.
  static constexpr std::size_t history = 16;
  struct Told {
    std::size_t input = 0;
    Reading reading;
  };
  struct Past {
    std::array<Reading, history> readings{};
    std::size_t count = 0;
  };

  void run();
  bool read_until_lost();
  void pause(std::int64_t ns);
  void tell(std::size_t input, const Reading& reading);
  void publish_losses();

  std::unique_ptr<Gauge> gauge_;
  Patience patience_;
  std::array<std::string, 4> sentences_;  // by Condition
  Ring<Told> told_;
  std::vector<Past> past_;  // the loop's
  std::atomic<Condition> condition_{Condition::gone};
  std::atomic<std::uint64_t> missing_{0};
  std::atomic<std::uint64_t> rejected_{0};
  std::uint64_t missing_before_ = 0;  // of earlier times that the gauge was open; its thread's
  std::uint64_t rejected_before_ = 0;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ = false;  // under mutex_
  std::thread thread_;
};

}  // namespace stickslip::drivers
