// SPDX-License-Identifier: Apache-2.0
// Parser of a program whose subcommands have notes for their manual pages.
#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <string>
#include <vector>

#include "tools/terminal/manual_page.h"

namespace stickslip::command_line {

enum class FileRole;

/// An option whose values are files (file_options.h).
struct FileOption {
  const CLI::Option* option;
  FileRole role;
};

class Program : public CLI::App {
 public:
  using CLI::App::App;

  /// Notes of the program itself or of one of its subcommands; empty if `describe` was not called.
  terminal::Notes notes(const CLI::App& command) const;

  void set_notes(const CLI::App& command, terminal::Notes notes);

  /// The options of a command that name files, in the order in which they were declared.
  std::vector<FileOption> file_options(const CLI::App& command) const;

  void add_file_option(const CLI::App& command, FileOption option);

 private:
  std::map<const CLI::App*, terminal::Notes> notes_;
  std::map<const CLI::App*, std::vector<FileOption>> file_options_;
};

/// The program that a command belongs to, at any depth. Throws std::logic_error if the root of the
/// parser is not a Program.
Program& program_of(CLI::App& command);
const Program& program_of(const CLI::App& command);

/// "stickslip log check".
std::string full_name(const CLI::App& command);

/// Sets the notes for the manual page of a command or of the program itself.
void describe(CLI::App& command, terminal::Notes notes);

// Notes that several commands share.
inline const terminal::Notes::Entry lcm_url_variable = {
    "LCM_DEFAULT_URL", "LCM URL if --url is not given; udpm://239.255.76.67:7667?ttl=0 if unset"};
inline const terminal::Notes::Entry no_color_variable = {
    "NO_COLOR", "If set and not empty, disables colours unless --color requests them"};
inline const terminal::Notes::Entry recording_files = {
    "*.log, *.csv",
    "Recordings: LCM event logs, or CSV with a column time_s and the channels in SI units. The "
    "format is detected from the content"};
inline const terminal::Notes::Entry model_files = {
    "PREFIX/share/stickslip/models/*.toml",
    "Models that are shipped: --model beam-1 is beam-1.toml of this folder. docs/configuration.md "
    "describes every key"};

}  // namespace stickslip::command_line
