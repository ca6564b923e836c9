// The real-time loop: acquire, calibrate, observe, drive, hand over. Everything that it needs is
// made before; a cycle does no allocation, lock, log or system call but the device's and the
// clock's.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/calibration.h"
#include "daemon/clock.h"
#include "daemon/estimate.h"
#include "daemon/excitation.h"
#include "daemon/ledger.h"
#include "daemon/ring.h"
#include "daemon/safety.h"
#include "daemon/sample.h"
#include "daemon/stream.h"
#include "daemon/timing.h"
#include "drivers/driver.h"

namespace stickslip::daemon {

/// Who decides when the next cycle is due.
enum class Pacing : std::uint8_t {
  deadlines,  ///< the loop, on absolute time; a full ring loses frames
  driver,     ///< the driver, which waits in read(); a full ring loses frames
  free,       ///< nobody: as fast as it goes, and a full ring makes the loop wait
};

struct LoopSettings {
  std::int64_t period_ns = 1'000'000;
  Pacing pacing = Pacing::deadlines;
  std::optional<std::uint64_t> frames =
      {};               ///< end after so many, the ramp down included; absent: none
  double ramp_s = 0.5;  ///< how long the excitation takes to come to rest
  std::int64_t longest_silence_ns =
      100'000'000;                         ///< of the device before it counts as lost; 0: any
  std::uint64_t frames_per_estimate = 10;  ///< every so many frames an estimate is handed over
  Calibration calibration{};
};

/// Why the loop ended.
struct LoopEnd {
  enum class Reason : std::uint8_t { none, asked, frames_done, end_of_data, fault };
  Reason reason = Reason::none;
  drivers::Outcome outcome = drivers::Outcome::ok;  ///< of a fault
  std::string message;                              ///< of a fault
};

class Loop {
 public:
  /// All that is referred to must outlive the loop; `driver` is open. `streams` may be empty,
  /// `observer` null.
  Loop(drivers::Driver& driver, Clock& clock, const LoopSettings& settings, Excitation excitation,
       Observer* observer, Ledger& ledger, std::vector<Stream*> streams);

  /// Starts the driver, runs cycles until the end, and leaves the amplifier off and the driver
  /// stopped. The calling thread is the real-time thread from here on.
  const LoopEnd& run();

  /// Any thread, and signal handlers. The first request ramps the excitation down, the second ends
  /// at once; the amplifier is off in both.
  void request_stop() { stop_requests_.fetch_add(1, std::memory_order_release); }

  /// One cycle without any waiting; false when it was the last. For benchmarks and tests: `run`
  /// is begin, (wait, cycle)*, end.
  bool begin();
  bool cycle();
  void end();

  /// What has been noticed, oldest first. One reader, any thread.
  bool next_notice(Notice& notice);

  const Timing& timing() const { return timing_; }
  RigState state() const { return published_state_.load(std::memory_order_relaxed); }
  const LoopEnd& why_ended() const { return why_; }

 private:
  void wait_for_cycle();
  bool read();
  void acquire(const Frame& raw);
  void check_sequence(const Frame& frame);
  void drive();
  void apply();
  void wait_for_room(const Stream& stream);
  void hand_over(const Sample& sample, const Estimate* estimate);
  void heed_stop_requests();
  void notice(Notice::Kind kind, std::uint64_t count = 0, std::int64_t duration_ns = 0,
              const char* text = "");
  void publish_state() { published_state_.store(safety_.state(), std::memory_order_relaxed); }
  void finish(LoopEnd::Reason reason);

  drivers::Driver& driver_;
  Clock& clock_;
  LoopSettings settings_;
  Excitation excitation_;
  Observer* observer_;
  Ledger& ledger_;
  std::vector<Stream*> streams_;
  bool can_drive_ = false;
  bool time_of_frames_ = false;  // rig time is told by the frames, not by the clock

  Safety safety_;
  Timing timing_;
  LoopEnd why_;
  Ring<Notice> notices_;
  std::atomic<int> stop_requests_{0};
  std::atomic<RigState> published_state_{RigState::idle};

  std::int64_t due_ns_ = 0;
  std::int64_t elapsed_ns_ = 0;  // rig time since the previous drive
  std::int64_t give_up_ns_ = 0;  // stop waiting for room in a ring; 0: not told to stop
  bool late_ = false;
  std::uint64_t restarts_ = 0;
  bool read_failing_ = false;
  bool write_failing_ = false;
  std::uint8_t not_finite_ = 0;
  std::uint64_t frames_ = 0;
  std::uint64_t stop_at_frame_ = 0;
  std::optional<Frame> previous_;
  Drive applied_;
  bool amplifier_on_ = false;
};

}  // namespace stickslip::daemon
