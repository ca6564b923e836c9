// SPDX-License-Identifier: Apache-2.0
// `stickslip ctl model`: another model for a running daemon.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "config/document.h"
#include "config/model_file.h"
#include "physics/problem.h"
#include "protocol/control.h"
#include "tools/command_line/file_options.h"
#include "tools/commands/commands.h"
#include "tools/control_client/control_client.h"
#include "tools/terminal/page.h"

namespace stickslip::commands {

using namespace command_line;
using namespace control_client;
namespace {

using nlohmann::json;

struct Arguments {
  std::shared_ptr<const std::string> socket;
  std::string file;
  std::shared_ptr<const bool> json_output;
};

/// The request. Throws InputError for a file with problems, or one that is longer than a line of
/// the socket.
json request_of(const std::string& file) {
  const std::string text = config::read_text(file);
  config::parse_model(text, file);
  const json out = {{"file", std::filesystem::absolute(file).lexically_normal().string()},
                    {"text", text}};
  const std::size_t bytes = protocol::control_request(0, "model", out).size();
  constexpr std::size_t spare = 64;  // for a longer id
  if (bytes + spare <= protocol::longest_control_line) return out;
  throw InputError(Problem{file, 0, 0,
                           "is too long for the control socket, " + std::to_string(bytes) +
                               " bytes: expected at most " +
                               std::to_string(protocol::longest_control_line - spare) +
                               "; restart the daemon with that model"});
}

int send_model(const Arguments& arguments) {
  const json request = request_of(arguments.file);
  ControlClient client(control_socket(*arguments.socket));
  const json answer = client.ask("model", request);
  const bool done = answer.value("ok", false);
  if (*arguments.json_output) {
    std::printf("%s\n", answer.dump().c_str());
  } else if (done) {
    terminal::print_page(answer.value("message", "") + "\n");
  } else {
    std::fprintf(stderr, "stickslip: refused by the daemon: %s\n",
                 answer.value("error", "no reason given").c_str());
  }
  return done ? 0 : 1;
}

}  // namespace

void add_ctl_model(CLI::App& ctl, std::shared_ptr<const std::string> socket,
                   std::shared_ptr<const bool> json_output, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  arguments->socket = std::move(socket);
  arguments->json_output = std::move(json_output);
  CLI::App* const command = ctl.add_subcommand(
      "model", "Take another model, such as a mended one, between two frames of the running rig");
  command->fallthrough();
  add_input(*command, "FILE", arguments->file, "Model file; the observer goes on from its state")
      ->type_name("FILE")
      ->required();
  command->callback([&action, arguments] { action = [=] { return send_model(*arguments); }; });
}

}  // namespace stickslip::commands
