// What came in on LCM, channel by channel, counted.
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

/// A number that messages of a channel hold: the last one, and between which it was.
struct Quantity {
  std::string name;
  std::string unit;
  double last = 0.0;
  double least = 0.0;
  double greatest = 0.0;
};

/// What came in on one channel since the start.
struct ChannelTraffic {
  std::string channel;
  std::string_view type;          ///< by name; empty: none of ours
  std::uint64_t fingerprint = 0;  ///< of the last message
  std::uint64_t messages = 0;
  std::uint64_t bytes = 0;       ///< of data, all messages
  std::uint32_t last_bytes = 0;  ///< of the last message
  std::uint64_t undecoded = 0;   ///< messages that are none of the channel's type
  std::int64_t last_us = 0;      ///< when the last came in

  bool is_frames = false;
  Sequence sequence;  ///< of frames
  std::uint64_t degraded_blocks = 0;

  std::vector<Quantity> quantities;  ///< in the order of their first appearance
  std::string words;                 ///< what the last message says
  terminal::Tone tone = terminal::Tone::plain;

  // Over the last interval that was closed.
  double rate_per_s = 0.0;
  double bytes_per_s = 0.0;
  std::optional<double> jitter_s;  ///< longest less shortest time between messages; absent below 2

  double age_s(std::int64_t now_us) const { return static_cast<double>(now_us - last_us) * 1e-6; }
};

class Traffic {
 public:
  /// `arrival_us`: any clock, in microseconds, that goes on.
  void take(const std::string& channel, std::span<const std::uint8_t> bytes,
            std::int64_t arrival_us);

  /// Ends an interval of so many seconds (above 0): rates and jitter are those within it.
  void close_interval(double seconds);

  /// By name.
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
