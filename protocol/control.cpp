// SPDX-License-Identifier: Apache-2.0
#include "protocol/control.h"

#include <nlohmann/json.hpp>

#include "physics/problem.h"

namespace stickslip::protocol {
namespace {

[[noreturn]] void refuse(const std::string& message) {
  throw InputError(Problem{"", 0, 0, message});
}

}  // namespace

ControlRequest parse_control_request(std::string_view line) {
  using nlohmann::json;
  // Deep nesting exhausts the stack of a recursive parser; no request needs it.
  constexpr int deepest = 8;
  bool too_deep = false;
  const auto shallow = [&too_deep](int depth, json::parse_event_t, json&) {
    too_deep = too_deep || depth > deepest;
    return !too_deep;
  };
  const json request = json::parse(line, shallow, false);
  if (too_deep) refuse("the request is nested too deeply");
  if (request.is_discarded() || !request.is_object()) {
    refuse("expected one JSON object per line, such as {\"v\": 1, \"id\": 1, \"do\": \"status\"}");
  }
  const auto version = request.find("v");
  if (version == request.end() || !version->is_number_integer() || *version != control_version) {
    refuse("this daemon uses version " + std::to_string(control_version) +
           " of the control protocol: expected \"v\": " + std::to_string(control_version));
  }
  ControlRequest out;
  if (const auto id = request.find("id"); id != request.end()) {
    if (!id->is_number_integer()) refuse("\"id\" has to be a whole number");
    out.id = id->get<std::int64_t>();
  }
  const auto command = request.find("do");
  if (command == request.end() || !command->is_string()) {
    refuse("expected \"do\": the name of a command");
  }
  out.command = command->get<std::string>();
  out.arguments = request.dump(-1, ' ', false, json::error_handler_t::replace);
  return out;
}

std::string control_request(std::int64_t id, std::string_view command,
                            const nlohmann::json& arguments) {
  nlohmann::json request = arguments.is_object() ? arguments : nlohmann::json::object();
  request["v"] = control_version;
  request["id"] = id;
  request["do"] = command;
  return request.dump() + '\n';
}

}  // namespace stickslip::protocol
