// SPDX-License-Identifier: Apache-2.0
// The subcommands of `stickslip`. Each is one file of this folder, named as the subcommand, that
// defines
//   void add_NAME(CLI::App& app, Action& action);
// which adds the subcommand with its options to the parser, sets `action` from its callback, and
// describes it for the manual. CMakeLists.txt finds the files.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "tools/command_line/action.h"
#include "tools/command_line/program.h"

namespace stickslip::commands {

using command_line::Action;
using command_line::describe;
using command_line::lcm_url_variable;
using command_line::model_files;
using command_line::no_color_variable;
using command_line::recording_files;

/// Adds all subcommands, in the order in which --help lists them. `action` must outlive the parser.
void add_subcommands(command_line::Program& program, Action& action);

/// `ctl calibrate`. `socket`: the option of `ctl`, set once the command line has been parsed.
void add_ctl_calibrate(CLI::App& ctl, std::shared_ptr<const std::string> socket, Action& action);

/// `ctl model`. `socket`, `json_output`: options of `ctl`, likewise.
void add_ctl_model(CLI::App& ctl, std::shared_ptr<const std::string> socket,
                   std::shared_ptr<const bool> json_output, Action& action);

}  // namespace stickslip::commands
