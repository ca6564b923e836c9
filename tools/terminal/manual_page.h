// SPDX-License-Identifier: Apache-2.0
// Manual pages generated from the definition of a command line, which makes them complete.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <utility>
#include <vector>

namespace stickslip::terminal {

/// Sections of a manual page that the definition of the command line does not contain.
struct Notes {
  struct Example {
    std::string purpose;  ///< a short phrase
    std::string command;  ///< as it is typed
  };
  /// Name and meaning.
  using Entry = std::pair<std::string, std::string>;

  std::vector<Example> examples = {};
  std::vector<Entry> environment = {};     ///< variables
  std::vector<Entry> files = {};           ///< paths
  std::string description = {};            ///< continues the command's own description
  std::vector<std::string> see_also = {};  ///< "stickslip-spy(1)"
};

/// Contents of the .TH line.
struct Heading {
  std::string program;  ///< "stickslip"
  int section = 1;
  std::string version;  ///< "0.1.0"
  std::string date;     ///< "2026-11-22"
};

/// Name of a page: "stickslip-log" for the command `log`; the program's own name for the program.
std::string page_name(const CLI::App& command, const Heading& heading);

/// Page of a program or of one of its commands, with the subcommands of the latter, in man(7)
/// markup. EXIT STATUS is the text behind "Exit status:" in the command's footer, followed by
/// `exit_status`, which applies to all commands.
std::string page(const CLI::App& command, const Heading& heading, const Notes& notes,
                 const std::string& exit_status);

/// Text behind "Exit status:" in a command's footer; empty if there is none.
std::string exit_status_of(const CLI::App& command);

/// Today, or the day given by SOURCE_DATE_EPOCH, for reproducible builds.
std::string build_date();

}  // namespace stickslip::terminal
