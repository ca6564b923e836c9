// SPDX-License-Identifier: Apache-2.0
// The parts of a CLI11 parser that documentation and completion are generated from.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace stickslip::terminal {

/// Subcommands in the order of their definition, hidden ones (empty group) excluded.
std::vector<const CLI::App*> visible_subcommands(const CLI::App& app);

/// Positional arguments, or options with a dash, in the order of their definition; hidden ones
/// (empty group) excluded.
std::vector<const CLI::Option*> visible_options(const CLI::App& app, bool positional);

bool takes_value(const CLI::Option& option);

/// Values that a CLI::IsMember check of the option permits; empty if there is no such check.
std::vector<std::string> choices_of(const CLI::Option& option);

}  // namespace stickslip::terminal
