// Which requests a poll of a unit consists of.
#pragma once

#include <cstddef>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "config/modbus_map.h"
#include "drivers/modbus/adu.h"

namespace stickslip::drivers::modbus {

/// Where a register's words are among the replies.
struct Place {
  std::size_t request = 0;  ///< of Plan::requests
  std::size_t first = 0;    ///< its first word in that reply
  friend bool operator==(const Place&, const Place&) = default;
};

struct Plan {
  std::vector<ReadRequest> requests;
  /// By register of the map; nothing: it is not read.
  std::vector<std::optional<Place>> places;
};

/// Reads the registers that are `needed`, by name, and every status and alarm. Registers of one
/// group and table travel in one request, with whatever lies between them, so that they are of one
/// moment; all others by themselves. A group that is longer than a request can be is refused where
/// the map is loaded; here it would be cut into as few as possible, and no value of it.
Plan plan_requests(const config::ModbusMap& map, const std::set<std::string>& needed);

}  // namespace stickslip::drivers::modbus
