// SPDX-License-Identifier: Apache-2.0
// Steps of the time in a series of frames, which sequence numbers do not show.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "physics/frame.h"

namespace stickslip::protocol {

/// A step of the time between consecutive frames that their sequence numbers do not explain: a
/// clock that was set, or a device that stood still. It differs from the regular interval by more
/// than ten periods of these frames, whatever their rate, and by more than a hundredth of any
/// stretch of lost frames, whose length the period gives no better.
struct TimeStep {
  std::uint64_t after_sequence = 0;
  std::int64_t after_ns = 0;  ///< time of the frame before
  double excess_s = 0.0;      ///< beyond the regular interval; negative: backwards
};

/// "the time steps by 5.000 s after 1.999 s (sequence 1999): ...".
std::string sentence_of(const TimeStep& step);

/// Collects the intervals of a recording of any length in bounded memory: the period is the median
/// of an evenly spaced subset.
class TimeSteps {
 public:
  /// An interval between two frames whose sequence numbers differ by `numbers` (at least 1).
  /// `sequence`: of the first.
  void add(std::uint64_t sequence, std::int64_t from_ns, std::int64_t to_ns, std::uint64_t numbers);
  /// The steps so far, in their order.
  std::vector<TimeStep> found();

 private:
  struct Candidate {
    TimeStep step;  ///< whose excess includes the regular interval
    double numbers = 1.0;
  };

  double median_s();
  void thin_out();
  void drop_regular_candidates();

  std::vector<double> intervals_s_;
  std::vector<Candidate> candidates_;
  double recent_s_ = 0.0;  ///< running mean of the period, in which a step counts ten at most
  std::uint64_t count_ = 0;
  std::uint64_t every_ = 1;
  bool full_ = false;  ///< of steps: no more are collected
};

/// The steps between frames of increasing sequence number.
std::vector<TimeStep> time_steps_of(std::span<const Frame> frames);

}  // namespace stickslip::protocol
