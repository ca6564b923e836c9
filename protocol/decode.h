// SPDX-License-Identifier: Apache-2.0
// Decoding of messages from untrusted bytes: network packets, damaged files.
#pragma once

#include <cstdint>
#include <span>
#include <stickslip/event_t.hpp>
#include <stickslip/excitation_t.hpp>
#include <stickslip/frame_block_t.hpp>
#include <stickslip/friction_estimate_t.hpp>
#include <stickslip/recorder_t.hpp>
#include <stickslip/recording_info_t.hpp>
#include <stickslip/status_t.hpp>
#include <stickslip/timing_t.hpp>

namespace stickslip::protocol {

/// Fills `message`. Returns false, with `message` unspecified, unless `bytes` are exactly one
/// message of its type, for a block of frames with a correct checksum. Never throws, and never
/// allocates more than a small multiple of the size of `bytes`, unlike the generated decoders,
/// which allocate as many elements as a message claims. Excitation, status and description of logs
/// of format 2 are decoded, too, without the fields added since.
bool decode(std::span<const std::uint8_t> bytes, frame_block_t& message);
bool decode(std::span<const std::uint8_t> bytes, friction_estimate_t& message);
bool decode(std::span<const std::uint8_t> bytes, excitation_t& message);
bool decode(std::span<const std::uint8_t> bytes, status_t& message);
bool decode(std::span<const std::uint8_t> bytes, timing_t& message);
bool decode(std::span<const std::uint8_t> bytes, event_t& message);
bool decode(std::span<const std::uint8_t> bytes, recording_info_t& message);
bool decode(std::span<const std::uint8_t> bytes, recorder_t& message);

}  // namespace stickslip::protocol
