// SPDX-License-Identifier: Apache-2.0
// `stickslip scope`: a live view of the rig in a browser.
#include <charconv>
#include <chrono>
#include <cstdio>
#include <exception>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "config/lcm_url.h"
#include "config/model_file.h"
#include "physics/failure.h"
#include "physics/number_text.h"
#include "physics/problem.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/control_client/control_client.h"
#include "tools/scope/listener.h"
#include "tools/scope/note_desk.h"
#include "tools/scope/page.h"
#include "tools/scope/recording_index.h"
#include "tools/scope/request.h"
#include "tools/scope/sources.h"
#include "tools/scope/web_server.h"
#include "tools/telemetry/lcm_client.h"
#include "tools/telemetry/lcm_packets.h"
#include "tools/telemetry/network_of.h"
#include "tools/terminal/progress.h"

namespace stickslip::commands {

using namespace command_line;
using namespace telemetry;

namespace {

using std::chrono::steady_clock;

struct Arguments {
  std::string url;
  std::string listen = "127.0.0.1:8088";
  scope::Admission admission;
  double history_s = 60.0;
  std::string model;
  std::string recording;  ///< shown instead of the rig; empty: none
  bool notes = false;
  std::string socket;  ///< of the daemon, for notes
  int network_of = 0;  ///< process ID; 0: none
  scope::ServerLimits limits;
};

double unix_ms_of(const lcm::ReceiveBuffer& buffer) {
  if (buffer.recv_utime > 0) return static_cast<double>(buffer.recv_utime) * 1e-3;
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration<double, std::milli>(now).count();
}

// Passes messages from LCM to the sources, without senders, which LCM does not name.
class Subscriber {
 public:
  explicit Subscriber(scope::Sources& sources) : sources_(sources) {}
  void take(const lcm::ReceiveBuffer* buffer, const std::string& channel) {
    sources_.take("", channel, {static_cast<const std::uint8_t*>(buffer->data), buffer->data_size},
                  unix_ms_of(*buffer), steady_clock::now());
  }

 private:
  scope::Sources& sources_;
};

/// Multicast is received with the senders of its packets; another provider by LCM.
class Reception {
 public:
  Reception(const std::string& url, scope::Sources& sources)
      : sources_(sources), subscriber_(sources), lcm_(join_lcm(url)) {
    if (config::parse_lcm_url(url).provider != "udpm") {
      listen<&Subscriber::take>(*lcm_, "STICKSLIP_.*", &subscriber_);
      return;
    }
    check_reception(*lcm_);
    lcm_.reset();
    packets_.emplace(url);
  }

  int file() const { return packets_ ? packets_->file() : lcm_->getFileno(); }

  void take() {
    if (!packets_) {
      for (int i = 0; i < 64 && lcm_->handleTimeout(0) > 0; ++i) {
      }
      return;
    }
    for (const LcmMessage& message : packets_->take()) {
      if (!message.channel.starts_with("STICKSLIP_")) continue;
      sources_.take(message.sender, message.channel, message.bytes, message.received_unix_ms,
                    steady_clock::now());
    }
  }

 private:
  scope::Sources& sources_;
  Subscriber subscriber_;
  std::unique_ptr<lcm::LCM> lcm_;
  std::optional<LcmReceiver> packets_;
};

void require_token(const Arguments& arguments, const scope::ListenAddress& at) {
  if (!scope::is_every_address(at.address) || !arguments.admission.token.empty()) return;
  throw InputError(Problem{"", 0, 0,
                           "--listen " + arguments.listen +
                               ": every network of this machine could watch; add --token WORD, or "
                               "listen at one address"});
}

void print_addresses(const scope::ListenAddress& at, const scope::Admission& admission) {
  const std::string query = admission.token.empty() ? "" : "?token=" + admission.token;
  const auto print = [&](const char* what, const std::string& address) {
    std::printf("%s: http://%s/%s\n", what, scope::text_of({address, at.port}).c_str(),
                query.c_str());
  };
  if (scope::is_every_address(at.address)) {
    print("live view", at.address == "0.0.0.0" ? "127.0.0.1" : "::1");
    for (const std::string& address : scope::addresses_of_this_machine()) {
      print("from other machines", address);
    }
  } else {
    print("live view", at.address);
  }
  std::printf("Ctrl-C stops it\n");
  std::fflush(stdout);
  if (!scope::is_loopback(at.address)) {
    std::fprintf(stderr,
                 "stickslip scope: anyone who can reach %s can watch%s; nothing is encrypted: see "
                 "docs/scope.md for a tunnel or a proxy\n",
                 scope::text_of(at).c_str(),
                 admission.token.empty() ? ", since no --token is required" : " with the token");
  }
}

void require_page() {
  if (!scope::page_files().empty()) return;
  throw Failure(
      "this program was built without the page of the live view, for want of uPlot: where the npm "
      "registry can be reached, configure it with -DSTICKSLIP_SCOPE=ON and build it again (see "
      "docs/development.md)");
}

std::vector<scope::Mark> marks_of(const Arguments& arguments) {
  if (arguments.model.empty()) return {};
  return scope::marks_of(config::load_model(arguments.model));
}

/// Passes a note to the daemon; empty if it was taken.
std::string pass_on(const std::string& socket, const scope::Note& note) {
  try {
    control_client::ControlClient client(control_client::control_socket(socket));
    nlohmann::json request = {{"text", note.text}};
    if (!note.rig.empty()) request["rig"] = note.rig;
    const nlohmann::json answer = client.ask("note", request, std::chrono::seconds(3));
    return answer.value("ok", false) ? "" : answer.value("error", "the daemon refused it");
  } catch (const std::exception& error) {
    return error.what();
  }
}

/// Takes notes from pages to the daemon, and its answers back.
class Notes {
 public:
  Notes(scope::WebServer& server, const scope::Sources& sources, std::string socket)
      : server_(server), desk_([socket = std::move(socket)](const scope::Note& note) {
          return pass_on(socket, note);
        }) {
    server.on_text([this, &sources](auto stream, auto wanted, auto text) {
      const std::optional<std::string> note = scope::decode_note(text);
      if (!note) return false;
      const std::string refusal =
          desk_.submit({stream, *note, sources.rig(wanted)}, steady_clock::now());
      if (!refusal.empty()) answer(stream, refusal);
      return true;
    });
    server.watch(desk_.file(), [this] {
      for (const auto& [page, refusal] : desk_.answered()) answer(page, refusal);
    });
  }

 private:
  void answer(scope::WebServer::StreamId stream, const std::string& refusal) {
    server_.send_to(stream, scope::shared_message(scope::encode_note_answer(refusal)));
  }

  scope::WebServer& server_;
  scope::NoteDesk desk_;
};

void serve(scope::WebServer& server, const StopSignals& stop, const scope::ListenAddress& at,
           const scope::Admission& admission) {
  server.watch(stop.file(), [&server] { server.stop(); });
  print_addresses(at, admission);
  server.run();
}

void serve_rig(const Arguments& arguments, const scope::Listener& listener,
               const scope::Admission& admission, const StopSignals& stop) {
  const scope::FeedSettings settings{.version = STICKSLIP_VERSION,
                                     .url = arguments.url,
                                     .history_s = arguments.history_s,
                                     .notes = arguments.notes,
                                     .marks = marks_of(arguments)};
  // The listening socket stays in this network namespace, LCM is joined in the other.
  if (arguments.network_of > 0) enter_network_of(arguments.network_of);
  std::unique_ptr<scope::WebServer> server;
  scope::Sources sources(settings, [&server](const auto& message, const auto& wants) {
    server->send(message, wants);
  });
  Reception reception(arguments.url, sources);
  server = std::make_unique<scope::WebServer>(
      listener, admission, arguments.limits, [&sources](std::string_view wanted) {
        return sources.greeting(wanted, steady_clock::now());
      });
  std::optional<Notes> notes;
  if (arguments.notes) notes.emplace(*server, sources, arguments.socket);
  server->watch(reception.file(), [&reception] { reception.take(); });
  server->every_tick([&sources] { sources.tick(steady_clock::now()); });
  serve(*server, stop, listener.address(), admission);
}

scope::RecordingIndex index_of(const Arguments& arguments) {
  terminal::Progress progress("reading " + arguments.recording);
  return {arguments.recording, marks_of(arguments),
          [&progress](double share) { progress.at(share); }};
}

void warn_of(const scope::Unshown& unshown, const std::string& file) {
  const std::int64_t bytes = unshown.damaged_bytes + unshown.cut_off_bytes;
  if (bytes == 0 && unshown.undecoded == 0 && unshown.events == 0) return;
  std::fprintf(stderr,
               "stickslip scope: %s: not shown are %s of damage, %s that cannot be read and %s\n",
               file.c_str(), physics::counted(static_cast<std::uint64_t>(bytes), "byte").c_str(),
               physics::counted(unshown.undecoded, "message").c_str(),
               physics::counted(unshown.events, "later event").c_str());
}

/// The summary, and pieces by their number, as a page asks for them.
std::optional<scope::WebServer::Content> content_of(const scope::RecordingIndex& recording,
                                                    const std::string& summary,
                                                    std::string_view path) {
  if (!path.starts_with(scope::recording_path)) return std::nullopt;
  path.remove_prefix(scope::recording_path.size());
  if (path.empty()) return {{"application/json", summary}};
  std::size_t number = 0;
  const char* const end = path.data() + path.size();
  const auto [read_to, error] = std::from_chars(path.data() + 1, end, number);
  if (path.front() != '/' || error != std::errc() || read_to != end) return std::nullopt;
  if (number >= recording.pieces()) return std::nullopt;
  return {{"application/octet-stream", recording.piece(number)}};
}

void serve_recording(const Arguments& arguments, const scope::Listener& listener,
                     const scope::Admission& admission, const StopSignals& stop) {
  const scope::RecordingIndex recording = index_of(arguments);
  warn_of(recording.unshown(), arguments.recording);
  const std::string summary = recording.summary();
  const auto hello = scope::shared_message(
      scope::encode_hello({.version = STICKSLIP_VERSION, .url = "", .recording = true}));
  const auto alive = scope::shared_message(scope::encode_alive(true, 0.0, 0.0));
  scope::WebServer server(listener, admission, arguments.limits, [&](std::string_view) {
    return std::vector<scope::SharedMessage>{hello, alive};
  });
  server.provide([&](std::string_view path) { return content_of(recording, summary, path); });
  server.every_tick([&] { server.send(alive); });
  serve(server, stop, listener.address(), admission);
}

int run(const Arguments& arguments) {
  require_page();
  const StopSignals stop;
  const scope::ListenAddress at = scope::parse_listen_address(arguments.listen);
  require_token(arguments, at);
  const scope::Listener listener(at);
  scope::Admission admission = arguments.admission;
  admission.listen_address = listener.address().address;
  const auto show = arguments.recording.empty() ? serve_rig : serve_recording;
  show(arguments, listener, admission, stop);
  return 0;
}

void add_access_options(CLI::App& command, Arguments& arguments) {
  command
      .add_option("--token", arguments.admission.token,
                  "Token that a browser must supply, as part of the page's address")
      ->envname("STICKSLIP_SCOPE_TOKEN")
      ->check(CLI::Validator(
          [](std::string& word) {
            return scope::is_token(word) ? std::string()
                                         : "expected letters, digits and -._~ only, as in a URL";
          },
          ""));
  command.add_option("--allow-origin", arguments.admission.allowed_origins,
                     "Origins of other pages that may open the stream, e.g. https://rig.lab");
  command.add_option("--host-name", arguments.admission.host_names,
                     "Host names to accept besides loopback and the address");
}

void add_limits(CLI::App& command, Arguments& arguments) {
  command.add_option("--pages", arguments.limits.streams, "Maximum number of open pages")
      ->check(whole_number(1, 500))
      ->capture_default_str();
  command
      .add_option("--pages-per-address", arguments.limits.streams_per_address,
                  "Maximum per address; behind a proxy all pages have the address of the proxy")
      ->check(whole_number(1, 500))
      ->capture_default_str();
  command
      .add_option(
          "--network-of", arguments.network_of,
          "Join LCM in the network namespace of the process with this ID, but listen in the "
          "current one")
      ->check(whole_number(1, 2147483647));
}

}  // namespace

void add_scope(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("scope", "Serve a live view of the rig for a browser");
  add_url_option(*command, arguments->url);
  command
      ->add_option("--listen", arguments->listen,
                   "Numeric address and port; port 0 selects a free one")
      ->capture_default_str();
  add_access_options(*command, *arguments);
  command
      ->add_option("--history", arguments->history_s,
                   "Frames that a page receives when it is opened [s]")
      ->check(number_that([](double v) { return v >= 0.0 && v <= 3600.0; },
                          "a number of seconds from 0 to 3600"))
      ->capture_default_str();
  add_input(*command, "--model", arguments->model,
            "Model whose frequencies are marked (default: the model published on LCM)")
      ->transform(shipped_file("models"));
  CLI::Option* const replay =
      add_input(*command, "--replay", arguments->recording,
                "Show this recording, an LCM event log, instead of the rig");
  command
      ->add_flag("--allow-notes", arguments->notes,
                 "Those who see the page may write notes into the rig's recording")
      ->excludes(replay);
  command
      ->add_option("--socket", arguments->socket,
                   "The daemon's control socket (default: $STICKSLIP_CONTROL, or "
                   "/run/stickslip/control.sock)")
      ->type_name("FILE");
  add_limits(*command, *arguments);
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
  describe(*command, {.examples = {{"Show the rig at http://127.0.0.1:8088", "stickslip scope"},
                                   {"Serve other hosts, with a token",
                                    "stickslip scope --listen 0.0.0.0:8088 --token s3cret"},
                                   {"Take notes on the page", "stickslip scope --allow-notes"},
                                   {"Show a recording", "stickslip scope --replay run.log"}},
                      .environment = {lcm_url_variable,
                                      {"STICKSLIP_SCOPE_TOKEN", "Token if --token is not given"},
                                      {"STICKSLIP_CONTROL",
                                       "Control socket of the daemon if --socket is not given"}},
                      .see_also = {"stickslip-spy(1)", "stickslipd(8)"}});
}

}  // namespace stickslip::commands
