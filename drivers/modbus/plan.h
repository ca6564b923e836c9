// SPDX-License-Identifier: Apache-2.0
// Requests of a poll of a unit.
#pragma once

#include <cstddef>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "config/modbus_map.h"
#include "drivers/modbus/adu.h"

namespace stickslip::drivers::modbus {

/// Position of the words of a register in the replies.
struct Place {
  std::size_t request = 0;  ///< index in Plan::requests
  std::size_t first = 0;    ///< first word in that reply
  friend bool operator==(const Place&, const Place&) = default;
};

struct Plan {
  std::vector<ReadRequest> requests;
  /// By register of the map; none: not read.
  std::vector<std::optional<Place>> places;
};

/// Reads the registers `needed`, by name, and all of role status and alarm. Registers of one group
/// and table are read by one request, including gaps, so that they are simultaneous; all others by
/// one request each. A group that exceeds the length of a request is rejected when the map is
/// loaded; here it would be split into as few requests as possible, without splitting a value.
Plan plan_requests(const config::ModbusMap& map, const std::set<std::string>& needed);

}  // namespace stickslip::drivers::modbus
