// SPDX-License-Identifier: Apache-2.0
// Option of the commands with coloured output.
#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <memory>
#include <string>

#include "tools/command_line/option_checks.h"
#include "tools/terminal/colour.h"

namespace stickslip::command_line {

/// Adds `--color`, which applies to standard output.
inline void add_colour_option(CLI::App& command, terminal::Colours& colours) {
  const std::map<std::string, terminal::Colours> choices = {{"auto", terminal::Colours::automatic},
                                                            {"always", terminal::Colours::always},
                                                            {"never", terminal::Colours::never}};
  command
      .add_option_function<std::string>(
          "--color",
          [&colours, choices](const std::string& chosen) { colours = choices.at(chosen); },
          "Colours: on a terminal unless NO_COLOR is set (auto), always, or never")
      ->check(one_of({"auto", "always", "never"}))
      ->default_str("auto");
}

}  // namespace stickslip::command_line
