// SPDX-License-Identifier: Apache-2.0
// Client of the daemon's control socket.
#pragma once

#include <chrono>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

namespace stickslip::control_client {

/// A connection to a daemon. Not thread-safe.
class ControlClient {
 public:
  /// Throws InputError, with a remedy, if no daemon listens at `socket` or access is denied.
  explicit ControlClient(const std::string& socket);
  ~ControlClient();
  ControlClient(const ControlClient&) = delete;
  ControlClient& operator=(const ControlClient&) = delete;

  /// Sends a command and waits for its answer; other lines received meanwhile are kept for `next`.
  /// Throws Failure if the daemon disconnects or does not answer within `timeout`.
  nlohmann::json ask(const std::string& command, const nlohmann::json& arguments = {},
                     std::chrono::milliseconds timeout = std::chrono::seconds(10));

  /// The next event or status of a `watch`; nullopt if none arrives within `wait`.
  std::optional<nlohmann::json> next(std::chrono::milliseconds wait);

  /// For polling together with other files.
  int file() const { return file_; }

 private:
  std::optional<nlohmann::json> line(std::chrono::steady_clock::time_point until);
  void send(const std::string& text);

  std::string socket_;
  int file_ = -1;
  std::int64_t next_id_ = 1;
  std::string in_;
  std::vector<nlohmann::json> kept_;
};

/// The option, else STICKSLIP_CONTROL, else the socket of the systemd service.
std::string control_socket(const std::string& option);

}  // namespace stickslip::control_client
