// SPDX-License-Identifier: Apache-2.0
// The channels on which a sensor effect acts.
#pragma once

#include <optional>
#include <string>

#include "physics/frame.h"
#include "physics/number_text.h"

namespace stickslip::physics {

/// The channels on which a sensor effect acts; empty for other relations.
struct Place {
  std::optional<Channel> channel;  ///< the channel with the sensor error
  std::optional<Channel> from;     ///< source channel, crosstalk only

  friend bool operator==(const Place&, const Place&) = default;
};

/// "friction_force channel"; "channel" without one.
inline std::string channel_words(const std::optional<Channel>& channel) {
  return channel ? std::string(info(*channel).stem) + " channel" : "channel";
}

/// "0.2 N": a reading of the channel with its unit.
inline std::string reading_text(double value, const Place& place) {
  const std::string number = number_text(value);
  return place.channel ? number + " " + std::string(info(*place.channel).unit) : number;
}

}  // namespace stickslip::physics
