// SPDX-License-Identifier: Apache-2.0
// Encoded messages.
#pragma once

#include <cstdint>
#include <vector>

#include "protocol/frame_block.h"

namespace stickslip::spy {

template <class Message>
std::vector<std::uint8_t> encoded(const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

/// A block of frames with these sequence numbers; the displacement [m] is a thousandth of each.
inline std::vector<std::uint8_t> block_of(const std::vector<std::uint64_t>& sequences) {
  std::vector<Frame> frames;
  for (const std::uint64_t sequence : sequences) {
    Frame frame;
    frame.sequence = sequence;
    frame.time_ns = static_cast<std::int64_t>(sequence) * 1'000'000;
    frame.set(Channel::displacement, 1e-3 * static_cast<double>(sequence));
    frames.push_back(frame);
  }
  frame_block_t block{};
  protocol::to_block(frames, block);
  return encoded(block);
}

}  // namespace stickslip::spy
