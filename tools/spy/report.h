// Traffic on LCM as a person and as a program read it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/spy/traffic.h"
#include "tools/terminal/colour.h"

namespace stickslip::spy {

enum class Order : std::uint8_t { name, rate, size, age, lost };

/// What of the traffic is told.
struct View {
  std::vector<std::string> words;  ///< channels whose name holds one of these; empty: all
  Order order = Order::name;       ///< others than name: the largest first
  bool values = false;             ///< every number with its least and greatest
};

/// The channels of a view, in its order.
std::vector<const ChannelTraffic*> seen_through(const View& view, const Traffic& traffic,
                                                std::int64_t now_us);

/// A table for a terminal, each line cut to `columns`; 0: not cut.
std::string table(const View& view, const Traffic& traffic, std::int64_t now_us,
                  std::size_t columns, const terminal::Paint& paint);

/// One line for each channel that says all by itself.
std::string lines(const View& view, const Traffic& traffic, std::int64_t now_us);

/// {"schema": 1, "seconds", "channels": [{"channel", "type", "fingerprint", "messages", ...}]} in
/// one line. type is null for those that are none of ours.
std::string json(const View& view, const Traffic& traffic, std::int64_t now_us, double seconds);

}  // namespace stickslip::spy
