// SPDX-License-Identifier: Apache-2.0
// Content of messages on LCM as readings and text.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "physics/frame.h"
#include "tools/terminal/colour.h"

namespace stickslip::spy {

/// Numerical field of a message.
struct Reading {
  std::string_view name;
  std::string_view unit;  ///< "1" for pure numbers
  double value = 0.0;
};

struct Content {
  std::string_view type;          ///< "frame_block_t"; empty: unknown
  bool decoded = false;           ///< false if a known type cannot be decoded
  std::vector<Frame> frames;      ///< of a block
  bool degraded = false;          ///< timing of the loop was degraded during the block
  std::vector<Reading> readings;  ///< of other messages
  std::string summary;            ///< one line
  terminal::Tone tone = terminal::Tone::plain;  ///< severity of the summary
};

/// LCM type fingerprint: the first eight bytes; 0 if there are fewer.
std::uint64_t fingerprint_of(std::span<const std::uint8_t> bytes);

/// Decodes a message by the type of its channel (protocol/channels.h), on other channels by the
/// fingerprint. Reuses the memory of `content`.
void read_message(std::string_view channel, std::span<const std::uint8_t> bytes, Content& content);

}  // namespace stickslip::spy
