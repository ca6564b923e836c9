// SPDX-License-Identifier: Apache-2.0
// Messages on the control socket: JSON, one object per line, in both directions.
//
//   {"v": 1, "id": 7, "do": "start", "dead_man": true}
//   {"v": 1, "id": 7, "ok": true, "state": "running"}
//   {"v": 1, "id": 8, "ok": false, "state": "idle", "error": "only an armed rig can be started"}
//   {"v": 1, "event": {...}}        to watching clients
//
// `id` is chosen by the client and returned; answers may come in another order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace stickslip::protocol {

inline constexpr int control_version = 1;

/// Default socket of daemon and tools.
inline constexpr const char* default_control_socket = "/run/stickslip/control.sock";

/// Longest line, its end included: a drive in samples, or a model file.
inline constexpr std::size_t longest_control_line = std::size_t{1024} * 1024;

struct ControlRequest {
  std::int64_t id = 0;
  std::string command;    ///< "start"
  std::string arguments;  ///< the whole object, as JSON
};

/// Throws InputError, with a message for the client, if the line is not a request of this version.
ControlRequest parse_control_request(std::string_view line);

/// Request line for `command`, its end included; `arguments` is an object.
std::string control_request(std::int64_t id, std::string_view command,
                            const nlohmann::json& arguments);

}  // namespace stickslip::protocol
