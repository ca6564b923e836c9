// SPDX-License-Identifier: Apache-2.0
// Decoding of messages as on the page, and frames for tests.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string_view>
#include <vector>

#include "physics/frame.h"
#include "tools/scope/message.h"

namespace stickslip::scope::test {

inline nlohmann::json read_json(const Message& message) {
  const auto payload = message.payload();
  return nlohmann::json::parse(payload.begin(), payload.end());
}

/// A block of frames, decoded independently of the encoder in the order of docs/scope.md.
struct ReadBlock {
  int kind = 0;
  unsigned flags = 0;
  std::size_t channels = 0;
  double received_unix_ms = 0.0;
  std::vector<std::int64_t> time_ns;
  std::vector<std::int64_t> sequence;
  std::vector<std::vector<std::uint64_t>> bits;  ///< by channel, to distinguish NaN and -0
};

template <class Number>
Number read_at(std::span<const std::uint8_t> bytes, std::size_t at) {
  Number out{};
  std::memcpy(&out, bytes.subspan(at, sizeof out).data(), sizeof out);
  return out;
}

inline ReadBlock read_block(const Message& message) {
  const auto bytes = message.payload();
  ReadBlock out;
  out.kind = bytes[0];
  out.flags = bytes[1];
  out.channels = read_at<std::uint16_t>(bytes, 2);
  const std::size_t n = read_at<std::uint32_t>(bytes, 4);
  out.received_unix_ms = read_at<double>(bytes, 8);
  std::size_t at = 16;
  for (std::size_t i = 0; i < n; ++i, at += 8) {
    out.time_ns.push_back(read_at<std::int64_t>(bytes, at));
  }
  for (std::size_t i = 0; i < n; ++i, at += 8) {
    out.sequence.push_back(read_at<std::int64_t>(bytes, at));
  }
  for (std::size_t channel = 0; channel < out.channels; ++channel) {
    out.bits.emplace_back();
    for (std::size_t i = 0; i < n; ++i, at += 8) {
      out.bits.back().push_back(read_at<std::uint64_t>(bytes, at));
    }
  }
  return out;
}

/// Frame `number` of a source of 1 kHz, with all channels.
inline Frame frame_at(std::uint64_t number) {
  Frame frame;
  frame.sequence = number;
  frame.time_ns = static_cast<std::int64_t>(number) * 1'000'000;
  for (const Channel channel : all_channels) {
    frame.set(channel,
              static_cast<double>(number) + 0.125 * static_cast<double>(index_of(channel)));
  }
  return frame;
}

inline std::vector<Frame> frames_from(std::uint64_t first, std::size_t count) {
  std::vector<Frame> out;
  for (std::size_t i = 0; i < count; ++i) out.push_back(frame_at(first + i));
  return out;
}

}  // namespace stickslip::scope::test
