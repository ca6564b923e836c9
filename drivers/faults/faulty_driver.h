// Faults on demand: any device, and what a script lets befall it. docs/faults.md says what each
// kind of fault does, and in which order they act.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/fault_script.h"
#include "drivers/driver.h"
#include "drivers/faults/chance.h"
#include "drivers/faults/timeline.h"
#include "drivers/host_clock.h"

namespace stickslip::drivers {

/// What one fault of the script has done.
struct Applied {
  std::uint64_t occurrences = 0;  ///< times that it has begun, as far as a call fell into them
  std::uint64_t hits = 0;         ///< frames, or calls, that it changed
  std::int64_t first_ns = 0;      ///< script time of the first hit
  std::int64_t last_ns = 0;       ///< of the last

  friend bool operator==(const Applied&, const Applied&) = default;
};

/// Where the device's frames went:
///   taken + duplicated = given + dropped + discarded + waiting
struct FrameAccount {
  std::uint64_t taken = 0;       ///< read from the device
  std::uint64_t given = 0;       ///< yielded by read
  std::uint64_t dropped = 0;     ///< by faults of that kind
  std::uint64_t duplicated = 0;  ///< frames that were made twice, each counted once
  std::uint64_t discarded = 0;   ///< were waiting when the device was unplugged or stopped
  std::uint64_t waiting = 0;     ///< will be given: a duplicate, or what was overtaken

  bool balances() const { return taken + duplicated == given + dropped + discarded + waiting; }

  friend bool operator==(const FrameAccount&, const FrameAccount&) = default;
};

/// How a device's time passes.
struct Pace {
  double period_s = 1.0e-3;  ///< device time from frame to frame, above 0
  double speed = 1.0;        ///< device time for host time, above 0: more than 1 for a fast replay
};

/// Stands before a device and yields what it yields, but for the faults of the script. The script
/// runs once in the life of this object, whatever is opened, closed or started anew; its time is 0
/// at the first frame and goes on with the frames' own, and by a period for each read that a fault
/// leaves without a frame. With the same script, frames and calls: the same faults, to the bit.
///
/// read and write allocate nothing; the only waiting of their own is what a stall is for, and a
/// period for each read that a paced device is not asked for.
///
/// Whatever the script says, "amplifier off" reaches the device: an unplugged one is told so at
/// once, and a write that fails still passes it on.
class FaultyDriver final : public Driver {
 public:
  /// Without a clock of its own: the host's.
  FaultyDriver(std::unique_ptr<Driver> device, const config::FaultScript& script, const Pace& pace,
               std::shared_ptr<HostClock> clock = nullptr);
  ~FaultyDriver() override;

  /// needs_attention where a fault is on a channel that the device does not yield; lost while the
  /// device is unplugged.
  Result open() override;
  Result start() override;
  Result read(Frame& frame) override;
  Result write(const Actuation& actuation) override;
  void stop() noexcept override;
  void close() noexcept override;
  const Description& description() const override { return description_; }
  Signals signals() const noexcept override;
  const char* left_on() const noexcept override { return device_->left_on(); }
  Counts counts() const noexcept override { return device_->counts(); }

  // Only from the thread that reads, or once it has ended.

  /// In the order of the script.
  const std::vector<Applied>& applied() const { return applied_; }
  FrameAccount account() const;
  /// Of the latest read; below 0 before the first.
  std::int64_t script_time_ns() const { return now_ns_; }

 private:
  struct Entry;
  enum class Fate : std::uint8_t { goes_on, overtaken, dropped };

  void describe();
  Result read_through(Frame& frame);
  Result withhold();
  Result unplug(const Entry& entry);
  Result still_unplugged() const;
  void block(const Occurrence& occurrence);
  bool is_withheld_next() const;
  Fate pass_on(Frame taken);
  Result give(Frame& frame);
  void queue(const Frame& frame, bool twice);
  void discard_waiting();

  void tell_time(const Frame& taken);
  void pass_periods(std::int64_t count);
  void pass_time_since_attempt();
  std::int64_t due_ns() const;

  void remember(const Frame& taken);
  void delay_channels(Frame& frame);
  void change(Entry& entry, const Occurrence& occurrence, Frame& frame);
  void stick(Entry& entry, const Occurrence& occurrence, Frame& frame);
  const Frame& as_of(std::int64_t time_ns) const;

  std::optional<Occurrence> lasting(Entry& entry, std::int64_t time_ns);
  void hit(const Entry& entry);
  void look_at_lines();

  std::unique_ptr<Driver> device_;
  std::shared_ptr<HostClock> clock_;
  std::int64_t period_ns_;
  double speed_;
  std::vector<Entry> entries_;  // in the order in which they act
  std::vector<Applied> applied_;
  FrameAccount account_;
  Description description_;
  std::string refusal_;

  bool running_ = false;
  const Entry* unplugged_by_ = nullptr;
  bool to_be_started_ = false;  // it was unplugged; underneath it may never have stopped
  Signals lines_;               // as the script has them

  // Script time.
  std::int64_t now_ns_;
  std::int64_t frameless_ns_ = 0;  // passed since the latest frame
  std::int64_t latest_frame_ns_ = 0;
  bool fresh_ = true;            // the next frame is the first since the start
  std::int64_t attempt_ns_ = 0;  // host time of the latest attempt to open an unplugged device
  std::int64_t since_attempt_ns_ = 0;  // script time that has passed since
  std::uint64_t reads_ = 0;
  std::uint64_t writes_ = 0;

  // The latest frames as the device gave them, for delays: a ring.
  std::vector<Frame> history_;
  std::size_t remembered_ = 0;
  std::size_t next_memory_ = 0;

  // Frames under way: overtaken and the one behind it, each perhaps twice.
  std::array<Frame, 4> queue_{};
  std::size_t queued_ = 0;
  std::optional<Frame> overtaken_;
  bool overtaken_twice_ = false;
  const Entry* overtaken_by_ = nullptr;
};

}  // namespace stickslip::drivers
