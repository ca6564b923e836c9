// SPDX-License-Identifier: Apache-2.0
// Part of a recording that is too long for memory: blocks of successive frames, spread over it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "physics/frame.h"
#include "protocol/recording.h"

namespace stickslip::protocol {

/// Takes the frames of a recording one by one, however many, and keeps all of them up to a number.
/// Beyond it blocks of them are left out, chosen by the golden ratio: a regular pattern could
/// coincide with a periodic drive. At least three quarters of that number are kept.
class SpreadFrames {
 public:
  explicit SpreadFrames(std::size_t most);

  void add(const Frame& frame);
  std::uint64_t count() const { return count_; }  ///< of all frames added
  /// Moves the frames into the recording, and the account of those that were left out.
  void finish(Recording& recording);

 private:
  bool is_kept(std::uint64_t block) const;
  void leave_out_more();

  std::size_t most_;
  std::size_t block_;  ///< frames in one
  double share_ = 1.0;
  std::uint64_t count_ = 0;
  std::vector<Frame> frames_;
  std::vector<std::uint64_t> kept_;  ///< numbers of the blocks that frames_ consists of
};

}  // namespace stickslip::protocol
