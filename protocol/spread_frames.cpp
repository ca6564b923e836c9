// SPDX-License-Identifier: Apache-2.0
#include "protocol/spread_frames.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace stickslip::protocol {

namespace {

constexpr std::size_t least_blocks = 16;

}  // namespace

SpreadFrames::SpreadFrames(std::size_t most)
    : most_(most), block_(std::max<std::size_t>(1, most / least_blocks)) {}

void SpreadFrames::add(const Frame& frame) {
  const std::uint64_t block = count_ / block_;
  const bool begins = count_ % block_ == 0;
  ++count_;
  if (!is_kept(block)) return;
  if (begins) kept_.push_back(block);
  frames_.push_back(frame);
  if (frames_.size() > most_) leave_out_more();
}

// A smaller share keeps a subset of what a larger one does.
bool SpreadFrames::is_kept(std::uint64_t block) const {
  const double turn = static_cast<double>(block) / std::numbers::phi;
  return share_ >= 1.0 || turn - std::floor(turn) < share_;
}

void SpreadFrames::leave_out_more() {
  while (frames_.size() > most_) {
    share_ *= 0.95;
    std::vector<std::uint64_t> kept;
    auto to = frames_.begin();
    for (std::size_t i = 0; i < kept_.size(); ++i) {
      if (!is_kept(kept_[i])) continue;
      kept.push_back(kept_[i]);
      const auto from = frames_.begin() + static_cast<std::ptrdiff_t>(i * block_);
      const std::size_t length = std::min(block_, frames_.size() - i * block_);
      to = std::copy_n(from, length, to);
    }
    frames_.erase(to, frames_.end());
    kept_ = std::move(kept);
  }
}

void SpreadFrames::finish(Recording& recording) {
  recording.left_out = count_ - frames_.size();
  for (std::size_t i = 1; i < kept_.size(); ++i) {
    if (kept_[i] != kept_[i - 1] + 1) recording.after_left_out.push_back(i * block_);
  }
  recording.frames = std::move(frames_);
}

}  // namespace stickslip::protocol
