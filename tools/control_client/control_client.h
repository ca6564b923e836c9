// The tools' end of the daemon's control socket.
#pragma once

#include <chrono>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

namespace stickslip::control_client {

/// A connection to a daemon. Not for several threads.
class ControlClient {
 public:
  /// Throws InputError where nobody listens at `socket` or this user may not, with what to do.
  explicit ControlClient(const std::string& socket);
  ~ControlClient();
  ControlClient(const ControlClient&) = delete;
  ControlClient& operator=(const ControlClient&) = delete;

  /// Asks and waits for the answer; what comes in between for a client that watches is kept for
  /// `next`. Throws std::runtime_error where the daemon goes away or does not answer within
  /// `patience`.
  nlohmann::json ask(const std::string& command, const nlohmann::json& arguments = {},
                     std::chrono::milliseconds patience = std::chrono::seconds(10));

  /// The next line that is no answer; nothing where none comes within `wait`.
  std::optional<nlohmann::json> next(std::chrono::milliseconds wait);

  /// To wait for, besides other things.
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

/// The option itself, else STICKSLIP_CONTROL, else where systemd's service listens.
std::string control_socket(const std::string& option);

}  // namespace stickslip::control_client
