// SPDX-License-Identifier: Apache-2.0
#include "tools/terminal/command_tree.h"

#include <sstream>

namespace stickslip::terminal {

std::vector<const CLI::App*> visible_subcommands(const CLI::App& app) {
  std::vector<const CLI::App*> out;
  for (const CLI::App* each : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (!each->get_group().empty()) out.push_back(each);
  }
  return out;
}

std::vector<const CLI::Option*> visible_options(const CLI::App& app, bool positional) {
  std::vector<const CLI::Option*> out;
  for (const CLI::Option* each : app.get_options()) {
    const bool hidden = each->get_group().empty();
    if (!hidden && each->get_positional() == positional) out.push_back(each);
  }
  return out;
}

bool takes_value(const CLI::Option& option) { return option.get_items_expected_max() != 0; }

std::vector<std::string> choices_of(const CLI::Option& option) {
  // CLI11 appends the description of each check to the type: "TEXT:{csv,lcm}".
  const std::string type = option.get_type_name();
  const auto open = type.find('{');
  const auto close = type.find('}', open);
  if (open == std::string::npos || close == std::string::npos) return {};
  std::vector<std::string> out;
  std::istringstream list(type.substr(open + 1, close - open - 1));
  for (std::string each; std::getline(list, each, ',');) out.push_back(each);
  return out;
}

}  // namespace stickslip::terminal
