// The real-time loop: acquire, calibrate, observe, judge, drive, hand over. Everything that it
// needs is made before; a cycle does no allocation, lock, log or system call but the device's and
// the clock's.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/calibration.h"
#include "daemon/clock.h"
#include "daemon/command.h"
#include "daemon/estimate.h"
#include "daemon/excitation.h"
#include "daemon/interlocks.h"
#include "daemon/latest.h"
#include "daemon/ledger.h"
#include "daemon/ring.h"
#include "daemon/safety.h"
#include "daemon/sample.h"
#include "daemon/stream.h"
#include "daemon/timing.h"
#include "drivers/device_clock.h"
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
      {};               ///< end after so many cycles, the ramp down included; absent: none
  double ramp_s = 0.5;  ///< how long the excitation takes to come to rest
  std::int64_t lateness_limit_ns = 0;      ///< of a wake-up before frames say so; 0: a period
  std::uint64_t frames_per_estimate = 10;  ///< every so many frames an estimate is handed over
  LiveSettings live = {};
  /// Clears, arms and starts by itself: for rigs on which nothing moves.
  bool start_at_once = false;
  bool end_on_fault = false;          ///< else the fault latches and the loop goes on
  const Stream* recorder = nullptr;   ///< whose losses the interlocks look at; may be null
  ModelCheck* model_check = nullptr;  ///< fed with the observer's estimates; may be null
};

/// Why the loop ended.
struct LoopEnd {
  enum class Reason : std::uint8_t { none, asked, frames_done, end_of_data, fault };
  Reason reason = Reason::none;
  drivers::Outcome outcome = drivers::Outcome::ok;  ///< of a fault
  std::string message;                              ///< of a fault
};

/// The rig at the end of the latest cycle.
struct Snapshot {
  std::int64_t clock_ns = 0;  ///< the loop's clock
  RigState state = RigState::faulted;
  Interlock interlock = Interlock::just_started;  ///< of the latched fault
  Cause cause;
  Interlock broken = Interlock::none;  ///< now, latched or not; keeps the rig from being armed
  Cause broken_cause;
  bool amplifier_on = false;
  bool device_here = true;
  bool late = false;
  drivers::Signals signals;
  Drive drive;
  Frame raw;
  Frame frame;  ///< calibrated
  std::uint64_t frames = 0;
  bool model_checked = false;
  ModelVerdict model;  ///< where the model is checked
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

  /// One thread besides the loop's: asks for something. False where the loop is behind by more than
  /// its ring holds.
  bool ask(const Command& command) { return commands_.push(command); }
  /// The same thread: the next answer, oldest first. An average may be overtaken by others.
  bool next_answer(Answer& answer);
  /// Any thread: the client that holds the dead-man's handle lives.
  void touch(std::int64_t now_ns) { touched_ns_.store(now_ns, std::memory_order_release); }

  /// One cycle without any waiting; false when it was the last. For benchmarks and tests: `run`
  /// is begin, (wait, cycle)*, end.
  bool begin();
  void wait();
  bool cycle();
  void end();

  /// What has been noticed, oldest first. One reader, any thread.
  bool next_notice(Notice& notice);

  /// Any thread. While the device is gone the loop leaves the driver alone, and another thread may
  /// close it, open it and start it; that thread says when it may be used again.
  bool device_is_gone() const { return device_.load(std::memory_order_acquire) == Device::gone; }
  /// Whether the driver said that it cannot go on.
  bool device_is_beyond_help() const { return beyond_help_.load(std::memory_order_acquire); }
  void device_is_back() { device_.store(Device::back, std::memory_order_release); }

  const Timing& timing() const { return timing_; }
  /// Any thread, whatever becomes of the device meanwhile.
  drivers::Counts device_counts() const { return driver_.counts(); }
  Snapshot snapshot() const { return snapshot_.read(); }
  const LoopEnd& why_ended() const { return why_; }

 private:
  enum class Device : std::uint8_t { here, gone, back };

  bool device_here() const { return device_.load(std::memory_order_relaxed) == Device::here; }
  void wait_without_device();
  void look_for_a_stall();
  void welcome_device();
  bool read();
  void acquire(Frame raw);
  bool place_in_time(Frame& frame);
  void check_model(const Estimate& estimate);
  void tell_new(Notice::Kind kind, std::uint8_t now, std::uint8_t before);
  void judge();
  void trip(const Interlocks::Broken& broken);
  void drive();
  void apply_drive();
  void wait_for_room(const Stream& stream);
  void hand_over(const Sample& sample, const Estimate* estimate);
  void heed_stop_requests();
  void heed_command();
  void obey(const Command& command, Answer& answer);
  void answer_average(const Cause* refusal);
  bool refuse(const Interlocks::Broken& broken, Answer& answer) const;
  bool change(RigInput input);
  bool is_over(bool more, bool at_rest);
  void notice(Notice::Kind kind, std::uint64_t count = 0, std::int64_t duration_ns = 0,
              const char* text = "");
  void publish(std::int64_t now_ns);
  void finish(LoopEnd::Reason reason);

  drivers::Driver& driver_;
  Clock& clock_;
  LoopSettings settings_;
  Excitation excitation_;
  Observer* observer_;
  Ledger& ledger_;
  std::vector<Stream*> streams_;
  bool can_drive_ = false;
  bool own_clock_ = false;
  bool time_of_frames_ = false;  // rig time is told by the frames, not by the clock

  Safety safety_;
  Interlocks interlocks_;
  Interlocks::Broken broken_;
  Timing timing_;
  LoopEnd why_;
  Ring<Notice> notices_;
  Ring<Command> commands_;
  Ring<Answer> answers_;
  Averaging averaging_;
  Latest<Snapshot> snapshot_;
  std::atomic<int> stop_requests_{0};
  std::atomic<std::int64_t> touched_ns_{0};
  std::atomic<Device> device_{Device::here};
  std::atomic<bool> beyond_help_{false};

  std::int64_t due_ns_ = 0;
  std::int64_t elapsed_ns_ = 0;           // rig time since the previous drive
  std::int64_t give_up_ns_ = 0;           // stop waiting for room in a ring; 0: not told to stop
  std::int64_t overrun_ns_ = 0;           // of this cycle
  std::optional<std::int64_t> begun_ns_;  // the cycle before, while the device paces the loop
  bool late_ = false;
  bool dead_man_ = false;
  std::uint64_t restarts_ = 0;
  bool read_failing_ = false;
  bool write_failing_ = false;
  std::uint8_t not_finite_ = 0;
  std::uint8_t beyond_calibration_ = 0;
  std::uint64_t frames_ = 0;
  std::uint64_t cycles_without_device_ = 0;
  std::uint64_t stop_at_cycle_ = 0;
  drivers::DeviceClock device_clock_;
  std::int64_t answered_ns_ = 0;       // when the device last answered a read, whatever it said
  std::int64_t time_offset_ns_ = 0;    // of a source whose time went back
  std::uint64_t sequence_offset_ = 0;  // of a device that came back and counts from 0 again
  std::uint64_t last_sequence_ = 0;
  std::uint64_t cycles_away_ = 0;  // since the device went
  bool numbering_is_new_ = false;
  bool repeating_ = false;
  Frame raw_;
  std::optional<Frame> previous_;
  Drive applied_;
  bool amplifier_on_ = false;
  drivers::Signals signals_;
};

}  // namespace stickslip::daemon
