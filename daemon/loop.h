// SPDX-License-Identifier: Apache-2.0
// The real-time loop: acquire, calibrate, observe, check the interlocks, drive, hand over. All
// memory is allocated at construction; a cycle allocates, locks and logs nothing and makes no
// system call but the device's and the clock's.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/calibration.h"
#include "daemon/clock.h"
#include "daemon/command.h"
#include "daemon/excitation.h"
#include "daemon/frame_sequencer.h"
#include "daemon/interlocks.h"
#include "daemon/ledger.h"
#include "daemon/observer_types.h"
#include "daemon/pacing.h"
#include "daemon/ring.h"
#include "daemon/safety.h"
#include "daemon/sample.h"
#include "daemon/seqlock.h"
#include "daemon/stream.h"
#include "daemon/timing.h"
#include "drivers/driver.h"

namespace stickslip::daemon {

struct LoopSettings {
  std::int64_t period_ns = 1'000'000;
  Pacing pacing = Pacing::deadlines;
  /// End after this number of cycles, ramp down included; absent: no limit.
  std::optional<std::uint64_t> frames = {};
  double ramp_s = 0.5;                     ///< time in which the excitation ramps down
  std::int64_t lateness_limit_ns = 0;      ///< of a wake-up, before frames are marked late; 0: a
                                           ///< period
  std::uint64_t frames_per_estimate = 10;  ///< frames between the estimates that are handed over
  LiveSettings live = {};
  /// Clears, arms and starts without an operator: for rigs without moving parts.
  bool start_at_once = false;
  bool end_on_fault = false;         ///< otherwise the fault latches and the loop goes on
  const Stream* recorder = nullptr;  ///< whose losses the interlocks watch; may be null
};

/// Why the loop ended.
struct LoopEnd {
  enum class Reason : std::uint8_t { none, requested, frames_done, end_of_data, fault };
  Reason reason = Reason::none;
  drivers::Outcome outcome = drivers::Outcome::ok;  ///< of a fault
  std::string message;                              ///< of a fault
};

/// State of the rig at the end of a cycle.
struct Snapshot {
  std::int64_t clock_ns = 0;  ///< the loop's clock
  RigState state = RigState::faulted;
  Interlock interlock = Interlock::just_started;  ///< of the latched fault
  Cause cause;
  Interlock broken = Interlock::none;  ///< at this moment, latched or not; prevents arming
  Cause broken_cause;
  bool amplifier_on = false;
  bool device_present = true;
  bool late = false;
  drivers::Signals signals;
  Drive drive;
  Frame raw;
  Frame frame;  ///< calibrated
  std::uint64_t frames = 0;
};

class Loop {
 public:
  /// Everything referred to must outlive the loop; `driver` is open. `streams` may be empty,
  /// `observer` null. The loop uses one observer at a time, this one until it has accepted a
  /// command with another; the observer that it used before is free again with the answer.
  Loop(drivers::Driver& driver, Clock& clock, const LoopSettings& settings, Excitation excitation,
       Observer* observer, Ledger& ledger, std::vector<Stream*> streams);

  /// Starts the driver, runs cycles until the end, and leaves the amplifier off and the driver
  /// stopped. The calling thread is the real-time thread.
  const LoopEnd& run();

  /// Any thread, and signal handlers. The first request ramps the excitation down, the second ends
  /// immediately; either leaves the amplifier off.
  void request_stop() { stop_requests_.fetch_add(1, std::memory_order_release); }

  /// One thread other than the loop's: queues a command. False if the queue is full.
  bool ask(const Command& command) { return commands_.push(command); }
  /// The same thread: the next answer, oldest first. The answer to an average may come after those
  /// to later commands.
  bool next_answer(Answer& answer);
  /// Any thread: keep-alive from the client that holds the dead-man's handle.
  void keep_alive(std::int64_t now_ns) { kept_alive_ns_.store(now_ns, std::memory_order_release); }

  /// `run` in steps, for benchmarks and tests: begin, (wait, cycle)*, end. `begin` is false where
  /// there is nothing to run, `cycle` (which does not wait) after the last cycle.
  bool begin();
  void wait();
  bool cycle();
  void end();

  /// The next notice, oldest first. One reader, any thread.
  bool next_notice(Notice& notice);

  /// Any thread. While the device is lost the loop does not use the driver, and another thread may
  /// close, open and start it; that thread then calls `device_restored`.
  bool device_lost() const { return device_.load(std::memory_order_acquire) == Device::lost; }
  /// True if the driver reported that it cannot recover.
  bool device_failed() const { return device_failed_.load(std::memory_order_acquire); }
  void device_restored() { device_.store(Device::restored, std::memory_order_release); }

  const Timing& timing() const { return timing_; }
  /// Any thread, in every state of the device.
  drivers::Counts device_counts() const { return driver_.counts(); }
  Snapshot snapshot() const { return snapshot_.read(); }
  const LoopEnd& end_status() const { return end_; }

 private:
  enum class Device : std::uint8_t { present, lost, restored };

  bool device_present() const { return device_.load(std::memory_order_relaxed) == Device::present; }
  std::uint64_t cycles_of_rig_time() const { return frames_ + cycles_without_device_; }
  void attach_device();
  bool read();
  void acquire(Frame raw);
  bool sequence(Frame& raw);
  Calibrated calibrate(const Frame& raw);
  const Estimate* observe(const Frame& frame);
  void report_new_channels(Notice::Kind kind, std::uint8_t now, std::uint8_t before);
  void check_interlocks();
  void trip(const Interlocks::Broken& broken);
  void drive();
  void apply_drive();
  void release_lost_device();
  void wait_for_consumer(const Stream& stream);
  void hand_over(const Sample& sample, const Estimate* estimate);
  void handle_stop_requests();
  void handle_command();
  void execute(const Command& command, Answer& answer);
  void drive_by(Excitation& next, Answer& answer);
  void observe_by(Observer& next, Answer& answer);
  void add_latest_frame(Answer& answer) const;
  void answer_average(const Cause* refusal);
  bool refuse_if_broken(const Interlocks::Broken& broken, Answer& answer) const;
  bool apply(RigInput input);
  bool is_over(bool more, bool at_rest);
  void notify(Notice::Kind kind, std::uint64_t count = 0, std::int64_t duration_ns = 0,
              const char* text = "");
  void publish_snapshot(std::int64_t now_ns);
  void finish(LoopEnd::Reason reason);

  drivers::Driver& driver_;
  Clock& clock_;
  LoopSettings settings_;
  Excitation excitation_;
  Observer* observer_;
  Ledger& ledger_;
  std::vector<Stream*> streams_;
  bool can_drive_ = false;
  Pacer pacer_;
  bool frame_time_ = false;  // rig time advances with the frames, not with the clock
  FrameSequencer sequencer_;

  Safety safety_;
  Interlocks interlocks_;
  Interlocks::Broken broken_;
  Timing timing_;
  LoopEnd end_;
  Ring<Notice> notices_;
  Ring<Command> commands_;
  Ring<Answer> answers_;
  Averaging averaging_;
  SeqLock<Snapshot> snapshot_;
  std::atomic<int> stop_requests_{0};
  std::atomic<std::int64_t> kept_alive_ns_{0};
  std::atomic<Device> device_{Device::present};
  std::atomic<bool> device_failed_{false};

  Wakeup wakeup_;                // of this cycle
  std::int64_t elapsed_ns_ = 0;  // rig time since the previous drive
  std::int64_t give_up_ns_ = 0;  // end of the wait for slow consumers; 0: no stop was requested
  bool dead_man_ = false;
  std::uint64_t observer_restarts_ = 0;
  bool read_failing_ = false;
  bool write_failing_ = false;
  std::uint8_t not_finite_ = 0;
  std::uint8_t beyond_calibration_ = 0;
  std::uint64_t frames_ = 0;
  std::uint64_t cycles_without_device_ = 0;
  std::uint64_t stop_at_cycle_ = 0;
  std::int64_t read_ns_ = 0;  // time of the device's latest answer to a read, whatever its outcome
  Frame raw_;
  std::optional<Frame> latest_;  // calibrated
  Drive applied_;
  bool amplifier_on_ = false;
  drivers::Signals signals_;
};

}  // namespace stickslip::daemon
