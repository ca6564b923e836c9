// Reads a gauge in a thread of its own, opens it again when it was lost, and keeps what it said for
// the loop, which never waits for it.
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

/// How long a gauge that cannot be opened, or is lost before it has said anything, is left alone,
/// doubling from first to longest.
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

  /// With `insist`: opens the gauge, which may take seconds, and starts its thread; where it cannot
  /// be opened, that is the answer, and no thread is started. Else the thread opens it, and goes on
  /// trying.
  Result open(bool insist);
  /// Ends the thread and closes the gauge.
  void close() noexcept;

  /// What the input said last at or before that time on the host's clock; not valid where it has
  /// said nothing since the gauge was opened, or nothing that it believes itself. Times do not
  /// decrease from call to call: boards hand their scans over in bursts, and a reading that is
  /// newer than a scan waits for a later one. Neither waits nor allocates.
  Reading latest(std::size_t input, std::int64_t time_ns);

  /// A sentence, while the gauge is not there; null while it is. Lives as long as this object.
  /// Neither waits nor allocates.
  const char* lost() const noexcept;

  Signals signals() const noexcept { return gauge_->signals(); }

  /// Of all times that the gauge was open. Any thread.
  GaugeLosses losses() const noexcept;

 private:
  enum class Condition : std::uint8_t { here, gone, needs_attention, beyond_help };
  struct Told {
    std::size_t input = 0;
    Reading reading;
  };

  void run();
  static Condition condition_after(Outcome outcome);
  bool read_until_lost();
  void pause(std::int64_t ns);
  void tell(std::size_t input, const Reading& reading);
  void tell_lost(Condition condition);
  void publish_losses();
  void keep_losses();

  std::unique_ptr<Gauge> gauge_;
  Patience patience_;
  std::array<std::string, 4> sentences_;  // by Condition
  moodycamel::ReaderWriterQueue<Told> told_;
  std::vector<Reading> latest_;  // by input; the loop's
  std::atomic<Condition> condition_{Condition::gone};
  std::atomic<std::uint64_t> missing_{0};
  std::atomic<std::uint64_t> rejected_{0};
  std::uint64_t missing_before_ = 0;  // of earlier times that the gauge was open; its thread's
  std::uint64_t rejected_before_ = 0;
  bool spoke_ = false;  // since it was opened; its thread's
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stopping_ = false;  // under mutex_
  std::thread thread_;
};

}  // namespace stickslip::drivers
