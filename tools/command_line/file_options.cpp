// SPDX-License-Identifier: Apache-2.0
#include "tools/command_line/file_options.h"

#include <vector>

#include "config/same_file.h"
#include "physics/problem.h"
#include "protocol/log_lock.h"
#include "tools/command_line/program.h"

namespace stickslip::command_line {

namespace {

struct NamedFile {
  std::string option;
  FileRole role;
  std::string name;
};

/// The files of the command line, and defaults of options that are not on it.
std::vector<NamedFile> files_of(const CLI::App& command) {
  std::vector<NamedFile> out;
  for (const FileOption& each : program_of(command).file_options(command)) {
    for (const std::string& name : each.option->results()) {
      if (!name.empty() && name != "-") out.push_back({each.option->get_name(), each.role, name});
    }
  }
  return out;
}

/// Throws InputError if two outputs are one file, or if an output folder is read.
void check_roles(const std::vector<NamedFile>& named) {
  for (std::size_t i = 0; i < named.size(); ++i) {
    if (named[i].role == FileRole::input) continue;
    for (std::size_t j = 0; j < named.size(); ++j) {
      if (i == j || (named[j].role != FileRole::input && j < i)) continue;
      if (!config::is_same_file(named[i].name, named[j].name)) continue;
      const std::string other =
          named[j].name == named[i].name ? "" : "is the same file as " + named[j].name + ", ";
      const std::string use = named[j].role == FileRole::input ? "is read" : "is written";
      throw InputError(Problem{named[i].name, 0, 0,
                               (other.empty() ? use : other + "which " + use) + " as " +
                                   named[j].option + ": expected another file for " +
                                   named[i].option});
    }
  }
}

}  // namespace

CLI::Option* declare_files(CLI::App& command, FileRole role, CLI::Option* option) {
  program_of(command).add_file_option(command, {option, role});
  const bool folder = role == FileRole::output_folder || role == FileRole::new_folder;
  option->type_name(folder ? "DIR" : "FILE");
  const bool replaces = role == FileRole::output || role == FileRole::output_folder;
  if (replaces && command.get_option_no_throw("--force") == nullptr) {
    command.add_flag("--force")->description(
        "Replace existing files that this command did not write");
  }
  return option;
}

files::Outputs outputs_of(const CLI::App& command) {
  const std::vector<NamedFile> named = files_of(command);
  check_roles(named);
  std::vector<std::string> inputs;
  for (const NamedFile& each : named) {
    if (each.role == FileRole::input) inputs.push_back(each.name);
  }
  const CLI::Option* force = command.get_option_no_throw("--force");
  files::Outputs outputs(full_name(command), std::move(inputs),
                         force != nullptr && force->count() > 0);
  for (const NamedFile& each : named) {
    if (each.role != FileRole::output) continue;
    protocol::require_free_log(each.name);
    outputs.check(each.name);
  }
  return outputs;
}

}  // namespace stickslip::command_line
