// SPDX-License-Identifier: Apache-2.0
// Shell completion, generated from the definition of a command line.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace stickslip::terminal {

enum class Shell : std::uint8_t { bash, zsh, fish };

/// Values to offer for options of a type name: {"KEY": {"loop.rate_hz", ...}}. Options with a
/// CLI::IsMember check list their values themselves.
using ChoicesByType = std::map<std::string, std::vector<std::string>>;

/// The script that a shell sources to complete the program's subcommands, options and values. File
/// names are offered where an option takes neither a number, a name nor one of a list.
std::string completion_script(Shell shell, const CLI::App& program,
                              const ChoicesByType& choices = {});

}  // namespace stickslip::terminal
