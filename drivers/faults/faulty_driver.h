// SPDX-License-Identifier: Apache-2.0
// Fault injection: a driver behind scripted faults. docs/faults.md defines the kinds of faults and
// their order.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/fault_script.h"
#include "drivers/clock/host_clock.h"
#include "drivers/driver.h"
#include "drivers/faults/chance.h"
#include "drivers/faults/timeline.h"

namespace stickslip::drivers {

/// Effects of one fault of the script.
struct Applied {
  std::uint64_t occurrences = 0;  ///< occurrences in which a call fell
  std::uint64_t hits = 0;         ///< frames or calls that it changed
  std::int64_t first_ns = 0;      ///< script time of the first hit
  std::int64_t last_ns = 0;       ///< script time of the last hit

  friend bool operator==(const Applied&, const Applied&) = default;
};

/// Balance of the device's frames:
///   taken + duplicated = given + dropped + discarded + waiting
struct FrameAccount {
  std::uint64_t taken = 0;       ///< read from the device
  std::uint64_t given = 0;       ///< yielded by read
  std::uint64_t dropped = 0;     ///< by faults of that kind
  std::uint64_t duplicated = 0;  ///< frames delivered twice, each counted once
  std::uint64_t discarded = 0;   ///< pending when the device was unplugged or stopped
  std::uint64_t waiting = 0;     ///< pending: a duplicate or an overtaken frame

  bool balances() const { return taken + duplicated == given + dropped + discarded + waiting; }

  friend bool operator==(const FrameAccount&, const FrameAccount&) = default;
};

/// Time base of a device.
struct Pace {
  double period_s = 1.0e-3;  ///< device time from frame to frame, above 0
  double speed = 1.0;        ///< device time per host time, above 0; more than 1 for a fast replay
};

/// Wraps a device and applies the faults of the script to its frames and calls. The script runs
/// once in the life of this object, however often it is opened, closed or started; its time is 0 at
/// the first frame and advances with the time of the frames, and by a period for each read that a
/// fault leaves without a frame. The same script, frames and calls give the same faults, bit for
/// bit.
///
/// read and write do not allocate; they wait only for a stall, and for a period in each read that
/// is withheld from a paced device.
///
/// Whatever the script, "amplifier off" reaches the device: it is sent when the device is
/// unplugged, and a write that fails still forwards it.
class FaultyDriver final : public Driver {
 public:
  /// `clock` defaults to the host's.
  FaultyDriver(std::unique_ptr<Driver> device, const config::FaultScript& script, const Pace& pace,
               std::shared_ptr<HostClock> clock = nullptr);
  ~FaultyDriver() override;

  /// needs_attention if a fault affects a channel that the device does not provide; lost while the
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

  // Only from the reading thread, or after it has ended.

  /// In the order of the script.
  const std::vector<Applied>& applied() const { return applied_; }
  FrameAccount account() const;
  /// Of the latest read; below 0 before the first.
  std::int64_t script_time_ns() const { return now_ns_; }

 private:
  struct Entry;
  enum class Fate : std::uint8_t { delivered, overtaken, dropped };

  void describe();
  Result read_with_faults(Frame& frame);
  Result withhold();
  Result unplug(const Entry& entry);
  Result still_unplugged() const;
  void block(const Occurrence& occurrence);
  bool will_be_withheld() const;
  Fate process(Frame taken);
  Result give(Frame& frame);
  void queue(const Frame& frame, bool twice);
  void discard_pending();

  void advance_time(const Frame& taken);
  void advance_periods(std::int64_t count);
  void advance_time_since_attempt();
  std::int64_t due_ns() const;

  void store(const Frame& taken);
  void delay_channels(Frame& frame);
  void change(Entry& entry, const Occurrence& occurrence, Frame& frame);
  void stick(Entry& entry, const Occurrence& occurrence, Frame& frame);
  const Frame& as_of(std::int64_t time_ns) const;

  std::optional<Occurrence> active_occurrence(Entry& entry, std::int64_t time_ns);
  void hit(const Entry& entry);
  void update_lines();

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
  bool to_be_started_ = false;  // after an unplug; the wrapped device may not have stopped
  Signals lines_;               // active by the script

  // Script time.
  std::int64_t now_ns_;
  std::int64_t frameless_ns_ = 0;  // elapsed since the latest frame
  std::int64_t latest_frame_ns_ = 0;
  bool fresh_ = true;                  // the next frame is the first since the start
  std::int64_t attempt_ns_ = 0;        // host time of the latest attempt to open while unplugged
  std::int64_t since_attempt_ns_ = 0;  // script time elapsed since
  std::uint64_t reads_ = 0;
  std::uint64_t writes_ = 0;

  // Ring buffer of the latest frames of the device, for delays.
  std::vector<Frame> history_;
  std::size_t history_size_ = 0;
  std::size_t history_next_ = 0;

  // Pending frames: an overtaken one and its successor, each possibly twice.
  std::array<Frame, 4> queue_{};
  std::size_t queued_ = 0;
  std::optional<Frame> overtaken_;
  bool overtaken_twice_ = false;
  const Entry* overtaken_by_ = nullptr;
};

}  // namespace stickslip::drivers
