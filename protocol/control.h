// What is said over the control socket: JSON, one object a line, in both directions.
//
//   {"v": 1, "id": 7, "do": "start", "dead_man": true}
//   {"v": 1, "id": 7, "ok": true, "state": "running"}
//   {"v": 1, "id": 8, "ok": false, "state": "idle", "error": "only an armed rig can be started"}
//   {"v": 1, "event": {...}}        to clients that watch
//
// `id` is the client's own and comes back; answers may overtake each other.
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace stickslip::protocol {

inline constexpr int control_version = 1;

/// Where daemon and tools meet unless told otherwise.
inline constexpr const char* default_control_socket = "/run/stickslip/control.sock";

/// No line may be longer, its end included.
inline constexpr std::size_t longest_control_line = std::size_t{64} * 1024;

struct ControlRequest {
  std::int64_t id = 0;
  std::string command;    ///< "start"
  std::string arguments;  ///< the whole object, as JSON
};

/// Throws InputError, with a message for whoever sent it, where a line is no request of this
/// version.
ControlRequest parse_control_request(std::string_view line);

/// The line that asks for `command`, its end included; `arguments` is an object.
std::string control_request(std::int64_t id, std::string_view command,
                            const nlohmann::json& arguments);

}  // namespace stickslip::protocol
