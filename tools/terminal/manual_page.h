// Manual pages out of the definition of a command line, so that no option can be missing or wrong.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <utility>
#include <vector>

namespace stickslip::terminal {

/// What a page says that the definition of its command line does not know.
struct Notes {
  struct Example {
    std::string what;     ///< a sentence
    std::string command;  ///< as it is typed
  };
  using Named = std::vector<std::pair<std::string, std::string>>;

  std::vector<Example> examples;
  Named environment;                       ///< names of variables and what they are for
  Named files;                             ///< paths and what they are
  std::string more = {};                   ///< of the description, after the command's own sentence
  std::vector<std::string> see_also = {};  ///< "stickslip-spy(1)"
};

/// Which page it is.
struct Heading {
  std::string program;  ///< "stickslip"
  int section = 1;
  std::string version;  ///< "0.1.0"
  std::string date;     ///< "2026-11-22"
};

/// "stickslip-log" for the command `log`; the program's own name for the program.
std::string name_of(const CLI::App& command, const Heading& heading);

/// The page of a program or of one of its commands, with the commands below it, in the language of
/// man(7). The exit status is what stands in the command's footer behind "Exit status:", and what
/// holds for all commands, `exit_status`.
std::string page(const CLI::App& command, const Heading& heading, const Notes& notes,
                 const std::string& exit_status);

/// The sentence behind "Exit status:" of a command's footer; empty where there is none.
std::string exit_status_of(const CLI::App& command);

/// Today, or the day that SOURCE_DATE_EPOCH names, for builds that can be repeated to the bit.
std::string date_of_build();

}  // namespace stickslip::terminal
