// SPDX-License-Identifier: Apache-2.0
#include "tools/command_line/run.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <optional>

#include "physics/failure.h"
#include "physics/spelling.h"
#include "tools/command_line/program.h"
#include "tools/terminal/command_tree.h"
#include "tools/terminal/page.h"

namespace stickslip::command_line {

namespace {

using terminal::takes_value;
using terminal::visible_options;
using terminal::visible_subcommands;

/// "log chekc" for a word after "stickslip log".
std::string as_typed(const CLI::App& command, const std::string& word) {
  const bool is_program = command.get_parent() == nullptr;
  return is_program ? word : as_typed(*command.get_parent(), command.get_name()) + " " + word;
}

std::string see_help(const CLI::App& command) {
  return " (see `" + full_name(command) + " --help`)";
}

std::vector<std::string> names_of_subcommands(const CLI::App& command) {
  std::vector<std::string> out;
  for (const CLI::App* each : visible_subcommands(command)) out.push_back(each->get_name());
  return out;
}

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : ", ") + name;
  return out;
}

const CLI::App* subcommand_of(const CLI::App& command, const std::string& name) {
  for (const CLI::App* each : visible_subcommands(command)) {
    if (each->get_name() == name) return each;
  }
  return nullptr;
}

std::string unknown_subcommand(const CLI::App& command, const std::string& word) {
  const std::vector<std::string> names = names_of_subcommands(command);
  const std::string meant = physics::nearest(word, names);
  return "there is no command \"" + as_typed(command, word) + "\"" +
         (meant.empty() ? "; expected one of " + joined(names)
                        : ": did you mean `" + full_name(command) + " " + meant + "`?");
}

/// The option of a command, or of one above it whose options it accepts; nullptr if unknown.
const CLI::Option* option_of(const CLI::App& command, const std::string& name) {
  if (const CLI::Option* found = command.get_option_no_throw(name)) return found;
  const bool upwards = command.get_fallthrough() && command.get_parent() != nullptr;
  return upwards ? option_of(*command.get_parent(), name) : nullptr;
}

void add_option_names(const CLI::App& command, std::vector<std::string>& names) {
  for (const CLI::Option* each : visible_options(command, false)) {
    for (const std::string& name : each->get_lnames()) names.push_back("--" + name);
  }
  if (command.get_fallthrough() && command.get_parent() != nullptr) {
    add_option_names(*command.get_parent(), names);
  }
}

std::string unknown_option(const CLI::App& command, const std::string& name) {
  std::vector<std::string> names;
  add_option_names(command, names);
  const std::string meant = physics::nearest(name, names);
  return "there is no option " + name + (meant.empty() ? "" : ": did you mean " + meant + "?") +
         see_help(command);
}

bool asks_for_help(const std::vector<std::string>& arguments) {
  return std::any_of(arguments.begin(), arguments.end(), [](const std::string& each) {
    return each == "--help" || each == "-h" || each == "--version";
  });
}

/// Of a command without its model: how to get one.
std::string without_model(const CLI::App& command) {
  const CLI::Option* recording = command.get_option_no_throw("RECORDING");
  const bool given = recording != nullptr && recording->count() > 0;
  std::string text =
      "--model is required, a file with the physics known of the rig: `stickslip model new";
  if (given) text.append(" --recording ").append(recording->results().front());
  return text.append("` asks for it and writes one; docs/tutorial.md shows it step by step");
}

/// Of what the parser refuses besides names: a value, a number of values, an argument too many.
std::string refusal(const Program& program, const CLI::ParseError& error) {
  const CLI::App* command = &program;
  while (!command->get_subcommands().empty()) command = command->get_subcommands().front();
  std::string text = error.what();
  if (dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr) {
    const std::vector<std::string> extra = program.remaining(true);
    text = "expected no further argument, found " + (extra.empty() ? "one" : extra.front());
  }
  const bool required = dynamic_cast<const CLI::RequiredError*>(&error) != nullptr;
  if (required && text == "--model is required") text = without_model(*command);
  return text + see_help(*command);
}

/// Exit status if there is nothing to run: --help, --version, or an error.
std::optional<int> parse(Program& program, std::vector<std::string> arguments) {
  if (const std::string wrong = wrong_name(program, arguments); !wrong.empty()) {
    std::fprintf(stderr, "%s: %s\n", program.get_name().c_str(), wrong.c_str());
    return 2;
  }
  std::reverse(arguments.begin(), arguments.end());  // the parser takes them from the back
  try {
    program.parse(std::move(arguments));
  } catch (const CLI::ParseError& error) {
    if (dynamic_cast<const CLI::CallForHelp*>(&error) != nullptr) {
      terminal::print_page(program.help());
      return 0;
    }
    if (error.get_exit_code() == 0) return program.exit(error);  // --version
    std::fprintf(stderr, "%s: %s\n", program.get_name().c_str(), refusal(program, error).c_str());
    return 2;
  }
  return std::nullopt;
}

void flush_output() {
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    throw Failure(std::string("standard output cannot be written: ") + std::strerror(errno));
  }
}

}  // namespace

std::string wrong_name(const CLI::App& program, const std::vector<std::string>& arguments) {
  if (asks_for_help(arguments)) return {};
  const CLI::App* command = &program;
  for (std::size_t i = 0; i < arguments.size() && arguments[i] != "--"; ++i) {
    const std::string& word = arguments[i];
    if (word.starts_with("--")) {
      const std::size_t equals = word.find('=');
      const CLI::Option* option = option_of(*command, word.substr(0, equals));
      if (option == nullptr) return unknown_option(*command, word.substr(0, equals));
      const bool value_follows = takes_value(*option) && equals == std::string::npos;
      if (value_follows)
        i += static_cast<std::size_t>(std::max(0, option->get_items_expected_min()));
    } else if (!word.starts_with("-") && !visible_subcommands(*command).empty()) {
      const CLI::App* chosen = subcommand_of(*command, word);
      if (chosen == nullptr) return unknown_subcommand(*command, word);
      command = chosen;
    }
  }
  const std::vector<std::string> names = names_of_subcommands(*command);
  if (names.empty()) return {};
  const std::string after = command == &program ? "" : " after \"" + full_name(*command) + "\"";
  return "no command is given" + after + "; expected one of " + joined(names);
}

int run(Program& program, const Action& action, const std::vector<std::string>& arguments) {
  try {
    if (const std::optional<int> status = parse(program, arguments)) return *status;
    const Action chosen = action;  // a copy: `manual` parses its examples, which sets it again
    const int status = chosen();
    flush_output();
    return status;
  } catch (const std::exception& error) {
    Ending ending = ending_of(error, program.get_name());
    if (const auto* at = dynamic_cast<const std::filesystem::filesystem_error*>(&error)) {
      ending.line = at->path1().string() + ": cannot be used: " + at->code().message();
    }
    std::fprintf(stderr, "%s: %s\n", program.get_name().c_str(), ending.line.c_str());
    const char* details = std::getenv("STICKSLIP_DETAILS");
    if (!ending.foreseen && details != nullptr && *details != '\0') {
      std::fprintf(stderr, "%s: %s\n", program.get_name().c_str(), error.what());
    }
    return ending.status;
  }
}

}  // namespace stickslip::command_line
