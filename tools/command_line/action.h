// What a subcommand leaves behind when the command line has been parsed.
#pragma once

#include <functional>

namespace stickslip::command_line {

/// Runs the chosen subcommand and returns its exit status. An InputError becomes status 2, any
/// other exception status 1, each with one line on standard error.
using Action = std::function<int()>;

}  // namespace stickslip::command_line
