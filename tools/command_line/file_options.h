// SPDX-License-Identifier: Apache-2.0
// Options that name files: what a command reads, and what it writes.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "tools/files/outputs.h"

namespace stickslip::command_line {

enum class FileRole {
  input,          ///< file or folder, read only
  output,         ///< file, replaced as a whole
  updated,        ///< file whose content is read and becomes part of the new one
  output_folder,  ///< folder that receives files
  new_folder,     ///< folder that is new or empty
};

/// Declares that the values of an option are files. Every option of a command that names a file is
/// declared. The first output adds --force, unless the command has an option of that name. Returns
/// the option.
CLI::Option* declare_files(CLI::App& command, FileRole role, CLI::Option* option);

/// Adds an option or an argument for files that the command reads.
template <class Value>
CLI::Option* add_input(CLI::App& command, const std::string& name, Value& value,
                       const std::string& description) {
  return declare_files(command, FileRole::input, command.add_option(name, value, description));
}

/// Adds an option or an argument for a file that the command writes.
template <class Value>
CLI::Option* add_output(CLI::App& command, const std::string& name, Value& value,
                        const std::string& description) {
  return declare_files(command, FileRole::output, command.add_option(name, value, description));
}

/// Adds an option or an argument for a folder that receives files.
template <class Value>
CLI::Option* add_output_folder(CLI::App& command, const std::string& name, Value& value,
                               const std::string& description) {
  return declare_files(command, FileRole::output_folder,
                       command.add_option(name, value, description));
}

/// The rules for the outputs of a command that has been parsed. Throws InputError if a declared
/// output is one of the inputs, must not be replaced, is another output, or is a log that a process
/// is writing.
files::Outputs outputs_of(const CLI::App& command);

}  // namespace stickslip::command_line
