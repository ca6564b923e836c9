// SPDX-License-Identifier: Apache-2.0
// Server of the control socket: passes clients' commands to the loop and returns its answers.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <set>
#include <string>

#include "daemon/drive_change.h"
#include "daemon/event.h"
#include "daemon/event_throttle.h"
#include "daemon/line_server.h"
#include "daemon/loop.h"
#include "daemon/model_change.h"
#include "daemon/status.h"
#include "protocol/control.h"

namespace stickslip::daemon {

/// Requests that the daemon answers without the loop.
struct ControlHandlers {
  std::function<Status()> status;
  /// Why a setting of the excitation is refused; nothing if it is allowed.
  std::function<std::optional<std::string>(const Setting&)> refusal;
  /// The loop has applied the setting.
  std::function<void(const Setting&)> was_set;
  /// The rig, for a client that designs runs.
  std::function<nlohmann::json()> describe;
  /// Publishes and records a note at the latest frame. `rig`: the one that it is about; empty: this
  /// one. Throws InputError for an invalid text or another rig.
  std::function<Event(const std::string& text, const std::string& rig)> note;
  /// Reloads the configuration and applies what can change while running; one line for each change.
  /// Throws InputError for an invalid configuration.
  std::function<std::vector<std::string>()> reload;
  /// A command to the loop for a model file. Throws InputError for one that is refused.
  std::function<Command(ModelFile)> propose_model;
  /// The answer to that command, or a refusal if it could not be queued; returns a sentence for the
  /// client if the model was taken.
  std::function<std::string(const Answer&)> model_answered;
  /// The same for a drive. Throws InputError for one that is refused.
  std::function<Command(DriveSamples)> propose_drive;
  std::function<std::string(const Answer&)> drive_answered;
};

class ControlServer {
 public:
  /// Everything referred to must outlive it.
  ControlServer(ListeningSocket socket, const LineServerSettings& settings, Loop& loop,
                Clock& clock, double rate_hz, ControlHandlers handlers);

  /// Serves clients for `wait` at most, less while answers are outstanding, or until the file
  /// `also` is readable. True if `also` is readable.
  bool serve(std::chrono::milliseconds wait, int also);

  /// To the clients that watch.
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
    Peer peer;
    std::int64_t id = 0;
    std::string request;  // in words, for the log
    std::uint64_t frames = 0;
    bool dead_man = false;
    std::optional<Setting> setting = {};
    std::chrono::steady_clock::time_point until;
  };

  void line(ClientId client, std::string_view text);
  void left(ClientId client, const std::string& why);
  void handle(ClientId client, const protocol::ControlRequest& request);
  bool answer_query(ClientId client, const protocol::ControlRequest& request);
  void take_note(ClientId client, const protocol::ControlRequest& request);
  Command command_of(const protocol::ControlRequest& request);
  void submit(ClientId client, const protocol::ControlRequest& request, Command command);
  void handle_answers();
  void handle_answer(const Answer& answer);
  void finish_exchanges(const Answer& answer, nlohmann::json& out);
  void restore_abandoned_drive();
  void drop_overdue();
  void answer(ClientId client, std::int64_t id, nlohmann::json content);
  void refuse(ClientId client, std::int64_t id, const std::string& why);
  Peer peer_of(ClientId client) const;
  void log(const Peer& peer, Severity severity, const std::string& what);
  void log_refusal(const Peer& peer, const std::string& request, const std::string& why);
  nlohmann::json rig_state() const;

  Loop& loop_;
  Clock& clock_;
  double rate_hz_;
  ControlHandlers handlers_;
  std::map<ClientId, Client> clients_;
  std::map<std::uint64_t, Waiting> waiting_;  // by command id
  std::uint64_t next_command_ = 1;
  std::uint64_t model_command_ = 0;  // that is not answered; 0: none
  std::uint64_t drive_command_ = 0;  // likewise
  ClientId proposer_ = 0;            // of that drive; 0: this server
  bool proposes_samples_ = false;
  EventThrottle log_;    // of the lines that clients cause
  ClientId holder_ = 0;  // of the dead-man's handle; 0: none
  ClientId driver_ = 0;  // whose samples the rig has; 0: the drive is the configured one
  LineServer server_;
};

/// The status as sent to clients.
nlohmann::json json_of(const Status& status);

}  // namespace stickslip::daemon
