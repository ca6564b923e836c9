// SPDX-License-Identifier: Apache-2.0
// Running a program from its command line to its exit status.
#pragma once

#include <string>
#include <vector>

#include "tools/command_line/action.h"
#include "tools/command_line/program.h"

namespace stickslip::command_line {

/// Parses `arguments` (without the program's name), runs the action that they set, and returns the
/// exit status. No exception leaves it: every error is one line on standard error. A misspelt
/// subcommand or option, at any depth, is answered with the name that was probably meant.
int run(Program& program, const Action& action, const std::vector<std::string>& arguments);

/// The error in the names of subcommands and options in `arguments`, as one sentence; empty if all
/// are known or help is requested. Values are left to the parser.
std::string wrong_name(const CLI::App& program, const std::vector<std::string>& arguments);

}  // namespace stickslip::command_line
