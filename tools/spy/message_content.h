// What a message on LCM says, for a person.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "physics/frame.h"
#include "tools/terminal/colour.h"

namespace stickslip::spy {

/// A number in a message.
struct Reading {
  std::string_view name;
  std::string_view unit;  ///< "1" for pure numbers
  double value = 0.0;
};

struct Content {
  std::string_view type;      ///< "frame_block_t"; empty: none of ours
  bool decoded = false;       ///< false where the type is ours and the bytes are no such message
  std::vector<Frame> frames;  ///< of a block
  bool degraded = false;      ///< the loop did not keep its time while the block was made
  std::vector<Reading> readings;                ///< of other messages
  std::string words;                            ///< all of it in one line
  terminal::Tone tone = terminal::Tone::plain;  ///< how bad that is
};

/// The first eight bytes, by which LCM tells types apart; 0 for less.
std::uint64_t fingerprint_of(std::span<const std::uint8_t> bytes);

/// By the type that belongs to the channel (protocol/channels.h), on other channels by the type
/// that the fingerprint tells. The memory of `content` is used again.
void read_message(std::string_view channel, std::span<const std::uint8_t> bytes, Content& content);

}  // namespace stickslip::spy
