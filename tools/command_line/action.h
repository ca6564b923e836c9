// SPDX-License-Identifier: Apache-2.0
// Result of parsing the command line: the subcommand to run.
#pragma once

#include <functional>

namespace stickslip::command_line {

/// Runs the selected subcommand and returns its exit status. `run` turns an InputError into status
/// 2 and any other exception into status 1, each with one line on standard error.
using Action = std::function<int()>;

}  // namespace stickslip::command_line
