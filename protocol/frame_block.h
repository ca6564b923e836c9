// Frames as the LCM message that carries them, and back.
#pragma once

#include <cstdint>
#include <span>
#include <stickslip/frame_block_t.hpp>
#include <vector>

#include "physics/frame.h"

namespace stickslip::protocol {

/// The most frames that a block may hold.
inline constexpr std::size_t longest_block = 10000;

/// Fills `block` with `frames`, 1 to longest_block of them, and its checksum; flags are 0.
/// Allocates only where the block was never as long before.
void to_block(std::span<const Frame> frames, frame_block_t& block);

/// Makes `bytes` what `to_block` with these `flags` would encode to, to the bit, without a block in
/// between. Allocates only where `bytes` never had as much room before.
void encode_block(std::span<const Frame> frames, std::int32_t flags,
                  std::vector<std::uint8_t>& bytes);

/// Appends the frames of `block` to `frames`. Returns false, with nothing appended, where the block
/// contradicts itself (a count that its arrays do not have). What a frame promises holds whatever
/// the sender did: a value without its bit becomes 0, one that is not finite loses its bit.
bool from_block(const frame_block_t& block, std::vector<Frame>& frames);

}  // namespace stickslip::protocol
