// Frames as the LCM message that carries them, and back.
#pragma once

#include <span>
#include <stickslip/frame_block_t.hpp>
#include <vector>

#include "physics/frame.h"

namespace stickslip::protocol {

/// Fills `block` with `frames`. Allocates only where the block was never as long before.
void to_block(std::span<const Frame> frames, frame_block_t& block);

/// Appends the frames of `block` to `frames`. Returns false, with nothing appended, where the block
/// contradicts itself (a count that its arrays do not have).
bool from_block(const frame_block_t& block, std::vector<Frame>& frames);

}  // namespace stickslip::protocol
