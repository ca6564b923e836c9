// SPDX-License-Identifier: Apache-2.0
// `stickslip scope`: a live view of the rig in a browser.
#include <chrono>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "config/lcm_url.h"
#include "config/model_file.h"
#include "physics/failure.h"
#include "physics/problem.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/option_checks.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/scope/listener.h"
#include "tools/scope/page.h"
#include "tools/scope/request.h"
#include "tools/scope/sources.h"
#include "tools/scope/web_server.h"
#include "tools/telemetry/lcm_client.h"
#include "tools/telemetry/lcm_packets.h"
#include "tools/telemetry/network_of.h"

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

int run(const Arguments& arguments) {
  require_page();
  const StopSignals stop;
  scope::FeedSettings settings;
  settings.version = STICKSLIP_VERSION;
  settings.url = arguments.url;
  settings.history_s = arguments.history_s;
  if (!arguments.model.empty()) {
    settings.marks = scope::marks_of(config::load_model(arguments.model));
  }
  const scope::ListenAddress at = scope::parse_listen_address(arguments.listen);
  require_token(arguments, at);
  const scope::Listener listener(at);
  scope::Admission admission = arguments.admission;
  admission.listen_address = listener.address().address;

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
  server->watch(reception.file(), [&reception] { reception.take(); });
  server->watch(stop.file(), [&server] { server->stop(); });
  server->every_tick([&sources] { sources.tick(steady_clock::now()); });
  print_addresses(listener.address(), admission);
  server->run();
  return 0;
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
  command
      ->add_option("--token", arguments->admission.token,
                   "Token that a browser must supply, as part of the page's address")
      ->envname("STICKSLIP_SCOPE_TOKEN")
      ->check(CLI::Validator(
          [](std::string& word) {
            return scope::is_token(word) ? std::string()
                                         : "expected letters, digits and -._~ only, as in a URL";
          },
          ""));
  command->add_option("--allow-origin", arguments->admission.allowed_origins,
                      "Origins of other pages that may open the stream, e.g. https://rig.lab");
  command->add_option("--host-name", arguments->admission.host_names,
                      "Host names to accept besides loopback and the address");
  command
      ->add_option("--history", arguments->history_s,
                   "Frames that a page receives when it is opened [s]")
      ->check(number_that([](double v) { return v >= 0.0 && v <= 3600.0; },
                          "a number of seconds from 0 to 3600"))
      ->capture_default_str();
  add_input(*command, "--model", arguments->model,
            "Model whose frequencies are marked (default: the model published on LCM)")
      ->transform(shipped_file("models"));
  command->add_option("--pages", arguments->limits.streams, "Maximum number of open pages")
      ->check(whole_number(1, 500))
      ->capture_default_str();
  command
      ->add_option("--pages-per-address", arguments->limits.streams_per_address,
                   "Maximum per address; behind a proxy all pages have the address of the proxy")
      ->check(whole_number(1, 500))
      ->capture_default_str();
  command
      ->add_option(
          "--network-of", arguments->network_of,
          "Join LCM in the network namespace of the process with this ID, but listen in the "
          "current one")
      ->check(whole_number(1, 2147483647));
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
  describe(*command, {.examples = {{"Show the rig at http://127.0.0.1:8088", "stickslip scope"},
                                   {"Serve other hosts, with a token",
                                    "stickslip scope --listen 0.0.0.0:8088 --token s3cret"}},
                      .environment = {lcm_url_variable,
                                      {"STICKSLIP_SCOPE_TOKEN", "Token if --token is not given"}},
                      .see_also = {"stickslip-spy(1)", "stickslipd(8)"}});
}

}  // namespace stickslip::commands
