// SPDX-License-Identifier: Apache-2.0
#include "daemon/control_server.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "physics/problem.h"

namespace stickslip::daemon {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

/// The loop answers within a cycle or two; after this time it is considered stopped.
constexpr auto answer_timeout = std::chrono::seconds(5);
constexpr double longest_average_s = 600.0;
/// Time of a keep-alive that releases the dead-man's handle.
constexpr std::int64_t released_ns = std::numeric_limits<std::int64_t>::min() / 4;

[[noreturn]] void refuse_request(const std::string& why) {
  throw InputError(Problem{"", 0, 0, why});
}

const char* word(Severity severity) {
  switch (severity) {
    case Severity::info:
      return "information";
    case Severity::warning:
      return "warning";
    case Severity::error:
      return "error";
  }
  return "information";
}

json json_of(const Event& event) {
  return {{"severity", word(event.severity)},
          {"code", event.code},
          {"message", event.message},
          {"time_ns", event.time_ns},
          {"sequence", event.sequence}};
}

json json_of(const AccountBalance& account) {
  json lost = json::object();
  for (std::size_t i = 0; i < loss_count; ++i) lost[std::string(loss_names[i])] = account.lost[i];
  return {{"enabled", account.enabled}, {"delivered", account.delivered}, {"lost", lost}};
}

/// Counts by device and name.
json json_of(const drivers::Counts& counts) {
  json out = json::object();
  for (const drivers::Count& count : counts.all()) out[count.device][count.name] = count.value;
  return out;
}

json json_of(const Frame& frame) {
  json out = json::object();
  for (const Channel channel : all_channels) {
    if (frame.has(channel)) out[std::string(info(channel).stem)] = frame[channel];
  }
  return out;
}

json json_of(const Average& average) {
  json channels = json::object();
  for (const Channel channel : all_channels) {
    const std::size_t i = index_of(channel);
    if (average.count[i] == 0) continue;
    channels[std::string(info(channel).stem)] = {{"mean", average.mean[i]},
                                                 {"deviation", average.deviation[i]},
                                                 {"count", average.count[i]},
                                                 {"independent", average.independent[i]}};
  }
  return {{"frames", average.frames}, {"raw", channels}};
}

bool flag(const json& arguments, const char* name) {
  const auto found = arguments.find(name);
  if (found == arguments.end()) return false;
  if (!found->is_boolean()) refuse_request(std::string("\"") + name + "\" must be true or false");
  return found->get<bool>();
}

double number(const json& arguments, const char* name) {
  const auto found = arguments.find(name);
  if (found == arguments.end() || !found->is_number()) {
    refuse_request(std::string("expected \"") + name + "\": a number");
  }
  return found->get<double>();
}

std::string text(const json& arguments, const char* name) {
  const auto found = arguments.find(name);
  if (found == arguments.end() || !found->is_string() || found->get<std::string>().empty()) {
    refuse_request(std::string("expected \"") + name + "\": a text");
  }
  return found->get<std::string>();
}

/// Without samples: the configured drive.
DriveSamples samples_of(const json& arguments) {
  DriveSamples out;
  const auto samples = arguments.find("samples");
  if (samples == arguments.end()) return out;
  out.period_s = number(arguments, "period_s");
  constexpr const char* expected = "expected \"samples\": a list of numbers";
  if (!samples->is_array() || samples->empty()) refuse_request(expected);
  for (const json& each : *samples) {
    if (!each.is_number()) refuse_request(expected);
    out.values.push_back(each.get<double>());
  }
  return out;
}

/// The command that `propose` returns; its refusals with file and line.
template <class Propose>
Command proposed(const Propose& propose) {
  try {
    return propose();
  } catch (const InputError& error) {
    refuse_request(error.what());
  }
}

Setting setting_of(const json& arguments) {
  const auto key = arguments.find("key");
  const std::string name =
      key != arguments.end() && key->is_string() ? key->get<std::string>() : "";
  constexpr std::string_view table = "excitation.";
  const auto tunable = tunable_named(name.starts_with(table) ? name.substr(table.size()) : name);
  if (!tunable) {
    refuse_request(
        "expected \"key\": excitation.carrier_hz, excitation.amplitude, "
        "excitation.modulation_hz or excitation.modulation_depth");
  }
  return {*tunable, number(arguments, "value")};
}

/// The command and its values, for the log: `set key="excitation.amplitude" value=0.01`. What an
/// untrusted client sent is escaped and shortened.
std::string words_for(const protocol::ControlRequest& request) {
  constexpr std::size_t longest = 200;
  const auto dump = [](const json& value) {
    return value.dump(-1, ' ', true, json::error_handler_t::replace);
  };
  const std::string name = dump(request.command);
  std::string out = name.substr(1, name.size() - 2);
  const json arguments = json::parse(request.arguments);
  for (const auto& [key, value] : arguments.items()) {
    if (out.size() > longest) break;
    if (key == "v" || key == "id" || key == "do" || key == "text" || key == "samples") {
      continue;
    }
    const std::string quoted = dump(key);
    out += ' ' + quoted.substr(1, quoted.size() - 2) + '=' + dump(value);
  }
  if (out.size() > longest) out.replace(longest, std::string::npos, "...");
  return out;
}

void write_line(const Event& event) {
  if (event.severity == Severity::info) {
    spdlog::info("{}", event.message);
  } else {
    spdlog::warn("{}", event.message);
  }
}

std::optional<Command::Kind> kind_of(const std::string& command) {
  if (command == "clear") return Command::Kind::clear;
  if (command == "arm") return Command::Kind::arm;
  if (command == "disarm") return Command::Kind::disarm;
  if (command == "start") return Command::Kind::start;
  if (command == "stop") return Command::Kind::stop;
  return std::nullopt;
}

json json_of(const diagnosis::Explanation& each) {
  return {{"relation", physics::name_of(each.relation)},
          {"channel", each.channel ? json(info(*each.channel).stem) : json(nullptr)},
          {"effect", each.name},
          {"statement", each.statement},
          {"chi2", each.chi2},
          {"probability", each.probability}};
}

json json_of(const Continuation& continuation) {
  return {{"kept", continuation.kept},      {"anew", continuation.anew},
          {"motion", continuation.motion},  {"mu", continuation.mu},
          {"gamma", continuation.gamma},    {"load", continuation.load},
          {"settled", continuation.settled}};
}

json model_of(const Status& status) {
  if (!status.model) return {{"standing", "off"}};
  const diagnosis::LiveVerdict& verdict = *status.model;
  json out = {{"standing", diagnosis::name_of(verdict.status)},
              {"chi2", verdict.chi2},
              {"limit", verdict.limit},
              {"alarms", verdict.alarms}};
  if (verdict.status != diagnosis::LiveStatus::broken) return out;
  out["statement"] = words_for(verdict);
  out["since_time_ns"] = verdict.since_ns;
  out["reported_time_ns"] = verdict.reported_ns;
  out["recording_time_ns"] = {verdict.from_ns(), verdict.to_ns()};
  out["certain"] = verdict.is_certain;
  out["explained"] = verdict.explanations.empty() ? "" : cause_in_words(verdict);
  out["explanations"] = json::array();
  for (const auto& each : verdict.explanations) out["explanations"].push_back(json_of(each));
  return out;
}

}  // namespace

json recording_of(const Status& status) {
  if (!status.recording) return nullptr;
  const RecordingProgress& recording = *status.recording;
  return {{"file", recording.file.string()},
          {"part", recording.part},
          {"file_bytes", recording.file_bytes},
          {"bytes", recording.bytes},
          {"length_s", static_cast<double>(recording.length_us) * 1e-6},
          {"free_bytes", status.free_bytes ? json(*status.free_bytes) : json()},
          {"failing", status.recording_failing}};
}

json json_of(const Status& status) {
  return {{"state", name_of(status.state)},
          {"interlock", status.state == RigState::faulted ? name_of(status.interlock) : ""},
          {"cause", status.cause},
          {"amplifier_on", status.amplifier_on},
          {"uptime_s", static_cast<double>(status.uptime_ns) * 1e-9},
          {"ledger",
           {{"produced", status.ledger.produced},
            {"published", json_of(status.ledger.published)},
            {"recorded", json_of(status.ledger.recorded)}}},
          {"timing",
           {{"cycles", status.cycles},
            {"overruns", status.overruns},
            {"late_cycles", status.late_cycles},
            {"skipped_periods", status.skipped_periods},
            {"longest_overrun_s", static_cast<double>(status.longest_overrun_ns) * 1e-9},
            {"lateness_p99_s", static_cast<double>(status.lateness_p99_ns) * 1e-9},
            {"lateness_max_s", static_cast<double>(status.lateness_max_ns) * 1e-9},
            {"cycle_p99_s", static_cast<double>(status.work_p99_ns) * 1e-9},
            {"cycle_max_s", static_cast<double>(status.work_max_ns) * 1e-9},
            {"degraded", status.degraded}}},
          {"source",
           {{"missing", status.missing_at_source},
            {"repeated", status.repeated},
            {"not_finite", status.not_finite},
            {"failed_reads", status.failed_reads},
            {"failed_writes", status.failed_writes},
            {"devices", json_of(status.devices)}}},
          {"recording", recording_of(status)},
          {"model", model_of(status)},
          {"lost_messages", status.lost_messages}};
}

ControlServer::ControlServer(ListeningSocket socket, const LineServerSettings& settings, Loop& loop,
                             Clock& clock, double rate_hz, ControlHandlers handlers)
    : loop_(loop),
      clock_(clock),
      rate_hz_(rate_hz),
      handlers_(std::move(handlers)),
      server_(std::move(socket), settings,
              {.joined =
                   [this](ClientId client, const Peer& peer) {
                     clients_[client].peer = peer;
                     spdlog::debug("control client {}: user {}, process {}", client, peer.uid,
                                   peer.pid);
                   },
               .line = [this](ClientId client, std::string_view text) { line(client, text); },
               .left = [this](ClientId client, const std::string& why) { left(client, why); }}) {}

void ControlServer::log(const Peer& peer, Severity severity, const std::string& what) {
  // An operator's session, but no program that repeats itself.
  constexpr Allowance allowance{.reports = 20.0, .per_second = 2.0};
  Event line{severity, "control",
             peer.pid == 0 ? "control socket: " + what
                           : "user " + std::to_string(peer.uid) + " (process " +
                                 std::to_string(peer.pid) + "): " + what};
  // A refusal may quote the client.
  std::replace_if(
      line.message.begin(), line.message.end(), [](unsigned char c) { return c < 0x20; }, ' ');
  line.subject = std::to_string(peer.uid);
  if (const auto now = log_.accept(line, clock_.now_ns(), allowance)) write_line(*now);
}

/// Of a client that has left or was never admitted: process 0.
Peer ControlServer::peer_of(ClientId client) const {
  const auto found = clients_.find(client);
  return found == clients_.end() ? Peer{} : found->second.peer;
}

bool ControlServer::serve(milliseconds wait, int also) {
  const bool can_read =
      server_.serve(waiting_.empty() ? wait : std::min(wait, milliseconds(2)), also);
  handle_answers();
  restore_abandoned_drive();
  for (const Event& line : log_.due(clock_.now_ns())) write_line(line);
  return can_read;
}

void ControlServer::line(ClientId client, std::string_view text) {
  std::int64_t id = 0;
  std::string words = "an unreadable request";
  try {
    const protocol::ControlRequest request = protocol::parse_control_request(text);
    id = request.id;
    words = words_for(request);
    handle(client, request);
  } catch (const InputError& error) {
    log_refusal(peer_of(client), words, error.problems().front().message);
    refuse(client, id, error.problems().front().message);
  }
}

void ControlServer::left(ClientId client, const std::string& why) {
  if (holder_ == client) {
    spdlog::warn("the client that held the dead-man's handle disconnected: {}", why);
    holder_ = 0;
    loop_.keep_alive(released_ns);
  } else if (why != "the client disconnected") {
    log(peer_of(client), Severity::warning, "disconnected: " + why);
  }
  clients_.erase(client);
}

void ControlServer::handle(ClientId client, const protocol::ControlRequest& request) {
  if (client == holder_) loop_.keep_alive(clock_.now_ns());
  if (answer_query(client, request)) return;
  if (request.command == "reload") {
    json out = rig_state();
    const std::vector<std::string> changes = handlers_.reload();
    out["changes"] = changes;
    std::string what = words_for(request) + ": accepted";
    for (const std::string& change : changes) what += "; " + change;
    log(peer_of(client), Severity::info, what);
    return answer(client, request.id, out);
  }
  if (request.command == "note") return take_note(client, request);
  submit(client, request, command_of(request));
}

void ControlServer::take_note(ClientId client, const protocol::ControlRequest& request) {
  const json arguments = json::parse(request.arguments);
  const std::string rig = arguments.contains("rig") ? text(arguments, "rig") : "";
  const Event note = handlers_.note(text(arguments, "text"), rig);
  json out = rig_state();
  out["time_ns"] = note.time_ns;
  out["sequence"] = note.sequence;
  // The text has a line of its own.
  log(peer_of(client), Severity::info, words_for(request) + ": accepted");
  answer(client, request.id, out);
}

/// False for a request that is not a query. Queries are not logged.
bool ControlServer::answer_query(ClientId client, const protocol::ControlRequest& request) {
  const std::string& name = request.command;
  if (name != "alive" && name != "status" && name != "watch" && name != "describe") return false;
  if (request.command == "watch") clients_[client].watches = true;
  json out = rig_state();
  if (request.command == "status") out["status"] = json_of(handlers_.status());
  if (request.command == "describe") out["rig"] = handlers_.describe();
  answer(client, request.id, out);
  return true;
}

Command ControlServer::command_of(const protocol::ControlRequest& request) {
  const json arguments = json::parse(request.arguments);
  const std::string& name = request.command;
  Command command;
  if (const auto kind = kind_of(name)) {
    command.kind = *kind;
    if (command.kind == Command::Kind::start) {
      command.dead_man = flag(arguments, "dead_man");
      if (command.dead_man && holder_ == 0) loop_.keep_alive(clock_.now_ns());
    }
  } else if (name == "set") {
    command.kind = Command::Kind::set;
    command.setting = setting_of(arguments);
    if (const auto why = handlers_.refusal(command.setting)) refuse_request(*why);
  } else if (name == "average") {
    const double seconds = number(arguments, "seconds");
    if (!(seconds > 0.0 && seconds <= longest_average_s)) {
      refuse_request("\"seconds\" must be above 0 and at most 600");
    }
    command.kind = Command::Kind::average;
    command.frames = static_cast<std::uint64_t>(std::ceil(seconds * rate_hz_));
  } else if (name == "model") {
    ModelFile file{text(arguments, "file"), text(arguments, "text")};
    command = proposed([&] { return handlers_.propose_model(std::move(file)); });
  } else if (name == "drive") {
    DriveSamples samples = samples_of(arguments);
    const bool has_samples = !samples.values.empty();
    command = proposed([&] { return handlers_.propose_drive(std::move(samples)); });
    proposes_samples_ = has_samples;
  } else {
    refuse_request("there is no command \"" + name.substr(0, 40) +
                   "\"; expected status, describe, clear, arm, disarm, start, stop, alive, set, "
                   "average, model, drive, note, reload or watch");
  }
  return command;
}

void ControlServer::submit(ClientId client, const protocol::ControlRequest& request,
                           Command command) {
  command.id = next_command_++;
  const bool is_model = command.kind == Command::Kind::observe;
  const bool is_drive = command.kind == Command::Kind::drive;
  if (!loop_.ask(command)) {
    if (is_model) handlers_.model_answered({});
    if (is_drive) handlers_.drive_answered({});
    refuse_request("the rig is busy with other commands; try again");
  }
  if (is_model) model_command_ = command.id;
  if (is_drive) {
    drive_command_ = command.id;
    proposer_ = client;
  }
  const auto timeout = answer_timeout + std::chrono::milliseconds(static_cast<std::int64_t>(
                                            1e3 * static_cast<double>(command.frames) / rate_hz_));
  waiting_[command.id] = {
      client,
      peer_of(client),
      request.id,
      words_for(request),
      command.frames,
      command.dead_man,
      command.kind == Command::Kind::set ? std::optional(command.setting) : std::nullopt,
      steady_clock::now() + timeout};
}

void ControlServer::handle_answers() {
  Answer answer;
  while (loop_.next_answer(answer)) handle_answer(answer);
  drop_overdue();
}

// Of what was lent to the loop; also if the client no longer waits for it.
void ControlServer::finish_exchanges(const Answer& received, json& out) {
  if (received.id == 0) return;
  std::string message;
  if (received.id == model_command_) {
    model_command_ = 0;
    message = handlers_.model_answered(received);
    if (!message.empty()) out["observer"] = json_of(received.continuation);
  }
  if (received.id == drive_command_) {
    drive_command_ = 0;
    message = handlers_.drive_answered(received);
    if (received.accepted) driver_ = proposes_samples_ ? proposer_ : 0;
  }
  if (message.empty()) return;
  out["message"] = message;
  out["time_ns"] = received.time_ns;
  out["sequence"] = received.sequence;
}

// Once the rig rests: the next start is not to play samples that a client left behind.
void ControlServer::restore_abandoned_drive() {
  if (driver_ == 0 || clients_.contains(driver_) || drive_command_ != 0) return;
  const RigState state = loop_.snapshot().state;
  if (state != RigState::idle && state != RigState::armed) return;
  Command command = handlers_.propose_drive({});
  command.id = next_command_++;
  if (!loop_.ask(command)) {
    handlers_.drive_answered({});
    return;
  }
  drive_command_ = command.id;
  proposes_samples_ = false;
}

void ControlServer::handle_answer(const Answer& received) {
  json out = {{"ok", true}, {"state", name_of(received.state)}};
  finish_exchanges(received, out);
  const auto found = waiting_.find(received.id);
  if (found == waiting_.end()) return;
  const Waiting request = found->second;
  waiting_.erase(found);
  const char* const state = name_of(received.state);
  if (!received.accepted) {
    log_refusal(request.peer, request.request, received.reason.c_str());
    return answer(request.client, request.id,
                  {{"ok", false}, {"state", state}, {"error", received.reason.c_str()}});
  }
  if (request.setting) handlers_.was_set(*request.setting);
  if (request.dead_man) {
    holder_ = clients_.contains(request.client) ? request.client : 0;
    if (holder_ == 0) loop_.keep_alive(released_ns);
  }
  log(request.peer, Severity::info,
      request.request + ": accepted, the rig is " + std::string(state));
  if (request.frames > 0) out["average"] = json_of(received.average);
  answer(request.client, request.id, out);
}

void ControlServer::drop_overdue() {
  const auto now = steady_clock::now();
  for (auto at = waiting_.begin(); at != waiting_.end();) {
    if (now < at->second.until) {
      ++at;
      continue;
    }
    const std::string why = "the loop does not respond; see stickslip ctl status";
    log_refusal(at->second.peer, at->second.request, why);
    refuse(at->second.client, at->second.id, why);
    at = waiting_.erase(at);
  }
}

json ControlServer::rig_state() const {
  const Snapshot rig = loop_.snapshot();
  return {{"ok", true},
          {"state", name_of(rig.state)},
          {"interlock", rig.state == RigState::faulted ? name_of(rig.interlock) : ""},
          {"cause", rig.cause.c_str()},
          {"broken", rig.broken == Interlock::none ? "" : name_of(rig.broken)},
          {"broken_cause", rig.broken_cause.c_str()},
          {"amplifier_on", rig.amplifier_on},
          {"device_here", rig.device_present},
          {"drive",
           {{"value", rig.drive.value},
            {"amplitude", rig.drive.amplitude},
            {"carrier_hz", rig.drive.carrier_hz},
            {"gain", rig.drive.gain},
            {"limited", rig.drive.limited == Limit::none ? "" : name_of(rig.drive.limited)}}},
          {"sequence", rig.frame.sequence},
          {"time_ns", rig.frame.time_ns},
          {"channels", json_of(rig.frame)},
          {"raw", json_of(rig.raw)}};
}

void ControlServer::answer(ClientId client, std::int64_t id, json content) {
  content["v"] = protocol::control_version;
  content["id"] = id;
  // A cause may contain text from a device that is not UTF-8.
  server_.send(client, content.dump(-1, ' ', false, json::error_handler_t::replace));
}

void ControlServer::refuse(ClientId client, std::int64_t id, const std::string& why) {
  answer(client, id, {{"ok", false}, {"state", name_of(loop_.snapshot().state)}, {"error", why}});
}

void ControlServer::log_refusal(const Peer& peer, const std::string& request,
                                const std::string& why) {
  log(peer, Severity::warning, request + ": refused: " + why);
}

void ControlServer::publish(const Event& event) {
  std::string text;
  for (const auto& [id, client] : clients_) {
    if (!client.watches) continue;
    if (text.empty()) {
      text = json{{"v", protocol::control_version}, {"event", json_of(event)}}.dump(
          -1, ' ', false, json::error_handler_t::replace);
    }
    server_.send(id, text);
  }
}

void ControlServer::publish(const Status& status) {
  std::string text;
  for (const auto& [id, client] : clients_) {
    if (!client.watches) continue;
    if (text.empty()) {
      json out = rig_state();
      out.erase("ok");
      out["v"] = protocol::control_version;
      out["status"] = json_of(status);
      text = out.dump(-1, ' ', false, json::error_handler_t::replace);
    }
    server_.send(id, text);
  }
}

}  // namespace stickslip::daemon
