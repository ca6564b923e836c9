// SPDX-License-Identifier: Apache-2.0
// Statistics of the LCM traffic per channel.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tools/spy/message_content.h"
#include "tools/spy/sequence.h"

namespace stickslip::spy {

/// Numerical field of the messages on a channel: last value and range.
struct Quantity {
  std::string name;
  std::string unit;
  double last = 0.0;
  double least = 0.0;
  double greatest = 0.0;
};

/// Statistics of one channel since the start.
struct ChannelTraffic {
  std::string channel;
  std::string_view type;          ///< name; empty: unknown
  std::uint64_t fingerprint = 0;  ///< of the last message
  std::uint64_t messages = 0;
  std::uint64_t bytes = 0;       ///< of data, all messages
  std::uint32_t last_bytes = 0;  ///< of the last message
  std::uint64_t undecoded = 0;   ///< messages that are not of the type of the channel
  std::int64_t last_us = 0;      ///< arrival of the last message

  bool is_frames = false;
  Sequence sequence;  ///< of frames
  std::uint64_t degraded_blocks = 0;

  std::vector<Quantity> quantities;  ///< in the order of their first appearance
  std::string summary;               ///< of the last message
  terminal::Tone tone = terminal::Tone::plain;

  // Over the last closed interval.
  double rate_per_s = 0.0;
  double bytes_per_s = 0.0;
  std::optional<double>
      jitter_s;  ///< longest less shortest time between messages; needs two such times

  double age_s(std::int64_t now_us) const { return static_cast<double>(now_us - last_us) * 1e-6; }
};

class Traffic {
 public:
  /// `arrival_us`: time of any clock that does not go backwards.
  void add(const std::string& channel, std::span<const std::uint8_t> bytes,
           std::int64_t arrival_us);

  /// Ends an interval of `seconds` > 0, over which rates and jitter are computed.
  void close_interval(double seconds);

  /// Sorted by name.
  std::vector<const ChannelTraffic*> channels() const;
  bool empty() const { return channels_.empty(); }
  bool has_frames() const;

 private:
  struct Counted {
    ChannelTraffic seen;
    std::uint64_t messages_before = 0;
    std::uint64_t bytes_before = 0;
    std::uint64_t gaps = 0;  // times between two messages, in this interval
    std::int64_t shortest_us = 0;
    std::int64_t longest_us = 0;
  };

  std::map<std::string, Counted> channels_;
  Content content_;
};

}  // namespace stickslip::spy
