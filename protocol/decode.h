// Messages out of bytes that nobody vouches for: packets of a network, a damaged file.
#pragma once

#include <cstdint>
#include <span>
#include <stickslip/event_t.hpp>
#include <stickslip/excitation_t.hpp>
#include <stickslip/frame_block_t.hpp>
#include <stickslip/friction_estimate_t.hpp>
#include <stickslip/recording_info_t.hpp>
#include <stickslip/status_t.hpp>
#include <stickslip/timing_t.hpp>

namespace stickslip::protocol {

/// Fills `message`; false, with `message` in no particular state, where `bytes` are not exactly one
/// message of its type, or a block of frames whose checksum is another. Never throws and never
/// allocates more than a small multiple of the size of `bytes`, which the generated decoders alone
/// do: they make room for as many elements as a message claims to have before they look for them.
/// Recordings outlive types: excitation, status and description are understood as logs of format 2
/// have them, too, without what has been added since.
bool decode(std::span<const std::uint8_t> bytes, frame_block_t& message);
bool decode(std::span<const std::uint8_t> bytes, friction_estimate_t& message);
bool decode(std::span<const std::uint8_t> bytes, excitation_t& message);
bool decode(std::span<const std::uint8_t> bytes, status_t& message);
bool decode(std::span<const std::uint8_t> bytes, timing_t& message);
bool decode(std::span<const std::uint8_t> bytes, event_t& message);
bool decode(std::span<const std::uint8_t> bytes, recording_info_t& message);

}  // namespace stickslip::protocol
