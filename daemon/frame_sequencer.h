// SPDX-License-Identifier: Apache-2.0
// Time stamps and sequence numbers of the frames that a device yields: both increase strictly from
// here on, whatever the source does. Pure: the time of reading is the caller's.
#pragma once

#include <cstdint>
#include <optional>

#include "physics/frame.h"

namespace stickslip::daemon {

/// Placement of a frame on the common time line.
struct FramePlacement {
  bool accepted = true;       ///< false: a sample that was seen before, to be left out
  bool first_repeat = false;  ///< the first of a row of frames that are left out
  std::uint64_t missing = 0;  ///< frames lost between the previous frame and this one
  std::int64_t step_ns = 0;   ///< rig time since the previous frame; one period after a gap
  /// The source's clock was set: ahead if positive (its time is kept), back if negative (its time
  /// is shifted from then on); 0: it was not.
  std::int64_t jump_ns = 0;
};

/// Does not allocate.
class FrameSequencer {
 public:
  /// `period_ns`: of the frames.
  explicit FrameSequencer(std::int64_t period_ns) : period_ns_(period_ns) {}

  /// Corrects time and sequence number of a frame that was read at `read_ns` (host time).
  FramePlacement place(Frame& frame, std::int64_t read_ns);

  /// A cycle passed without a device: its frame counts as missing.
  void skip_cycle() { ++cycles_skipped_; }

  /// The device is a new one, or was restarted: it may count from 0 again.
  void restart_numbering() { renumber_ = true; }

 private:
  struct Stamp {
    std::int64_t time_ns = 0;
    std::uint64_t sequence = 0;
    std::int64_t read_ns = 0;
  };

  /// A longer step is a gap, or a clock that was set: not a time to drive the excitation by.
  static constexpr std::int64_t longest_step_ns = 1'000'000'000;
  /// A smaller or shorter jump is jitter of the source.
  static constexpr std::int64_t smallest_jump_ns = 100'000'000;
  static constexpr std::int64_t smallest_jump_periods = 10;

  void renumber(Frame& frame);
  std::int64_t jump_ahead_ns(const Frame& frame, std::int64_t read_ns) const;

  std::int64_t period_ns_;
  std::int64_t time_offset_ns_ = 0;    // of a source whose time went back
  std::uint64_t sequence_offset_ = 0;  // of a device that was restarted
  std::uint64_t cycles_skipped_ = 0;   // since the device was lost
  bool renumber_ = false;
  bool repeating_ = false;
  std::optional<Stamp> previous_;
};

}  // namespace stickslip::daemon
