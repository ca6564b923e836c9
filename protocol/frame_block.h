// SPDX-License-Identifier: Apache-2.0
// Conversion of frames to and from their LCM message.
#pragma once

#include <cstdint>
#include <span>
#include <stickslip/frame_block_t.hpp>
#include <vector>

#include "physics/frame.h"

namespace stickslip::protocol {

/// Largest number of frames in a block.
inline constexpr std::size_t longest_block = 10000;

/// Fills `block` with `frames`, 1 to longest_block of them, and its checksum; flags are 0.
/// Allocates only if the block was never as long before.
void to_block(std::span<const Frame> frames, frame_block_t& block);

/// The encoding of a block from `to_block` with these `flags`, without an intermediate block.
/// Allocates only if the capacity of `bytes` is too small.
void encode_block(std::span<const Frame> frames, std::int32_t flags,
                  std::vector<std::uint8_t>& bytes);

/// Appends the frames of `block` to `frames`. Returns false, with nothing appended, if the block is
/// inconsistent (a count that differs from the size of its arrays). The invariants of a frame are
/// restored: a value without its bit becomes 0, the bit of a value that is not finite is cleared.
bool from_block(const frame_block_t& block, std::vector<Frame>& frames);

}  // namespace stickslip::protocol
