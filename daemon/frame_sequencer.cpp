// SPDX-License-Identifier: Apache-2.0
#include "daemon/frame_sequencer.h"

#include <algorithm>

namespace stickslip::daemon {

void FrameSequencer::renumber(Frame& frame) {
  if (renumber_) {
    const std::uint64_t last = previous_ ? previous_->sequence : 0;
    sequence_offset_ = last + 1 + cycles_skipped_ - frame.sequence;
    cycles_skipped_ = 0;
    renumber_ = false;
  }
  frame.sequence += sequence_offset_;
}

/// Time beyond the periods since the previous frame that did not pass on the host either; 0 for
/// less than a jump.
std::int64_t FrameSequencer::jump_ahead_ns(const Frame& frame, std::int64_t read_ns) const {
  const auto periods = static_cast<std::int64_t>(frame.sequence - previous_->sequence);
  const std::int64_t step_ns = frame.time_ns - previous_->time_ns;
  if (periods >= step_ns / period_ns_) return 0;
  const std::int64_t passed_ns = std::max(periods * period_ns_, read_ns - previous_->read_ns);
  const std::int64_t jump_ns = step_ns - passed_ns;
  return jump_ns >= std::max(smallest_jump_ns, smallest_jump_periods * period_ns_) ? jump_ns : 0;
}

FramePlacement FrameSequencer::place(Frame& frame, std::int64_t read_ns) {
  FramePlacement out;
  renumber(frame);
  if (previous_ && frame.sequence <= previous_->sequence) {
    out.accepted = false;
    out.first_repeat = !repeating_;
    repeating_ = true;
    return out;
  }
  repeating_ = false;
  frame.time_ns += time_offset_ns_;
  if (previous_) {
    out.missing = frame.sequence - previous_->sequence - 1;
    if (frame.time_ns <= previous_->time_ns) {
      const std::int64_t periods = static_cast<std::int64_t>(out.missing) + 1;
      const std::int64_t shift_ns = previous_->time_ns + periods * period_ns_ - frame.time_ns;
      time_offset_ns_ += shift_ns;
      frame.time_ns += shift_ns;
      out.jump_ns = -shift_ns;
    } else {
      out.jump_ns = jump_ahead_ns(frame, read_ns);
    }
  }
  const std::int64_t step_ns = previous_ ? frame.time_ns - previous_->time_ns : 0;
  out.step_ns = step_ns > 0 && step_ns <= longest_step_ns ? step_ns : period_ns_;
  previous_ = {frame.time_ns, frame.sequence, read_ns};
  return out;
}

}  // namespace stickslip::daemon
