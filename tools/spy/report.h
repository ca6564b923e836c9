// SPDX-License-Identifier: Apache-2.0
// Statistics of the LCM traffic as text and as JSON.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/spy/traffic.h"
#include "tools/terminal/colour.h"

namespace stickslip::spy {

enum class Order : std::uint8_t { name, rate, size, age, lost };

/// Selection and order of the channels.
struct View {
  std::vector<std::string> name_filters;  ///< channels whose name contains one of these; empty: all
  Order order = Order::name;              ///< descending, except by name
  bool values = false;                    ///< show every value with its range
};

/// The channels of a view, in its order.
std::vector<const ChannelTraffic*> selected_channels(const View& view, const Traffic& traffic,
                                                     std::int64_t now_us);

/// A table for a terminal, each line truncated to `columns`; 0: not truncated.
std::string table(const View& view, const Traffic& traffic, std::int64_t now_us,
                  std::size_t columns, const terminal::Paint& paint);

/// One self-contained line per channel.
std::string lines(const View& view, const Traffic& traffic, std::int64_t now_us);

/// {"schema": 1, "seconds", "channels": [{"channel", "type", "fingerprint", "messages", ...}]} in
/// one line. type is null if it is unknown.
std::string json(const View& view, const Traffic& traffic, std::int64_t now_us, double seconds);

}  // namespace stickslip::spy
