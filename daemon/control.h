// The one door for commands: what clients ask over the control socket, handed to the loop, and its
// answers. LCM never commands.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <set>
#include <string>

#include "daemon/event.h"
#include "daemon/line_server.h"
#include "daemon/loop.h"
#include "daemon/status.h"
#include "protocol/control.h"

namespace stickslip::daemon {

/// What the daemon does besides the loop when a client asks.
struct ControlHandlers {
  std::function<Status()> status;
  /// Why a knob of the excitation may not be turned so far; nothing where it may.
  std::function<std::optional<std::string>(const Setting&)> refusal;
  /// It has been.
  std::function<void(const Setting&)> was_set;
  /// Reads the configuration again and applies what can change; one line each of what did and what
  /// did not. Throws InputError where it is not sound.
  std::function<std::vector<std::string>()> reload;
};

/// Lines for the log at no client's discretion: a burst, then a few a second.
class LogBudget {
 public:
  bool allows(std::chrono::steady_clock::time_point now);

 private:
  double lines_ = 20.0;
  std::chrono::steady_clock::time_point latest_{};
};

class Control {
 public:
  /// Everything referred to must outlive it. Throws InputError where the socket cannot be made.
  Control(const LineServerSettings& settings, Loop& loop, Clock& clock, double rate_hz,
          ControlHandlers handlers);

  /// Serves clients for at most `wait`, less while answers are outstanding, or until `also` can be
  /// read. Whether `also` can be read.
  bool serve(std::chrono::milliseconds wait, int also);

  /// Passes on what happened to the clients that watch.
  void publish(const Event& event);
  void publish(const Status& status);

 private:
  using ClientId = LineServer::ClientId;
  struct Client {
    Peer peer;
    bool watches = false;
  };
  struct Waiting {
    ClientId client = 0;
    std::int64_t id = 0;
    std::uint64_t frames = 0;
    bool dead_man = false;
    std::optional<Setting> setting = {};
    std::chrono::steady_clock::time_point until;
  };

  void line(ClientId client, std::string_view text);
  void left(ClientId client, const std::string& why);
  void obey(ClientId client, const protocol::ControlRequest& request);
  void ask(ClientId client, const protocol::ControlRequest& request, Command command);
  void take_answers();
  void answer(ClientId client, std::int64_t id, nlohmann::json content);
  void refuse(ClientId client, std::int64_t id, const std::string& why);
  nlohmann::json rig_state() const;

  Loop& loop_;
  Clock& clock_;
  double rate_hz_;
  ControlHandlers handlers_;
  std::map<ClientId, Client> clients_;
  std::map<std::uint64_t, Waiting> waiting_;  // by the number of the command
  std::uint64_t next_command_ = 1;
  LogBudget log_;
  ClientId holder_ = 0;  // of the dead-man's handle; 0: nobody
  LineServer server_;
};

/// The status as clients read it.
nlohmann::json json_of(const Status& status);

}  // namespace stickslip::daemon
