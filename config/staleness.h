// SPDX-License-Identifier: Apache-2.0
// Age that readings of the slower devices of a bench reach when one reply is lost.
#pragma once

#include <string>
#include <vector>

#include "config/bench.h"

namespace stickslip::config {

struct LongestAge {
  std::string path;    ///< of the device in the rig file: "modbus.0"
  std::string device;  ///< as in inputs.CHANNEL.from: "lvdt"
  double age_s = 0.0;  ///< of its last reading just before the next one arrives
  std::string remedy;  ///< keys of the device that shorten it
};

/// The slower devices (bridge, Modbus units, instruments on serial lines) that are the source of a
/// channel, with the age [s] of their readings after a single reply, report or line was lost. That
/// of a Modbus unit is the sum of
///   - its poll period, or the time of all requests on its bus if that is longer,
///   - the longest time-out on the bus; three of its own on a serial line if several of its
///     requests have replies of the same form, as a late reply to one would pass for that to
///     another (see drivers/modbus/modbus_bus.h),
///   - all requests on its bus, and the repeated one,
/// where a request takes its transmission and 10 ms for the unit and the adapter.
std::vector<LongestAge> ages_after_a_lost_reply(const Bench& bench);

}  // namespace stickslip::config
