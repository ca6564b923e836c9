// SPDX-License-Identifier: Apache-2.0
#include "tools/terminal/completion.h"

#include <functional>
#include <string_view>
#include <utility>

#include "tools/terminal/command_tree.h"

namespace stickslip::terminal {
namespace {

using Words = std::vector<std::string>;

/// Value of an option or of a positional argument.
struct Value {
  enum class Kind { none, any, choice, file };
  Kind kind = Kind::none;
  Words choices;
};

struct CompletedOption {
  Words names;  ///< with their dashes
  std::string description;
  Value value;
};

/// The program or one of its subcommands.
struct CompletedCommand {
  Words path;  ///< names of the subcommands that lead to it; empty for the program
  std::string description;
  std::vector<CompletedOption> options;
  Value positional;  ///< one for all positional arguments
  std::vector<CompletedCommand> commands;
};

std::string joined(const Words& words, std::string_view separator) {
  std::string out;
  for (const std::string& word : words) out += (out.empty() ? "" : std::string(separator)) + word;
  return out;
}

Value value_of(const CLI::Option& option, const ChoicesByType& choices) {
  if (!takes_value(option)) return {};
  const Words listed = choices_of(option);
  if (!listed.empty()) return {Value::Kind::choice, listed};
  const std::string type = option.get_type_name();
  if (const auto known = choices.find(type); known != choices.end()) {
    return {Value::Kind::choice, known->second};
  }
  for (const char* no_file : {"FLOAT", "INT", "UINT", "NAME"}) {
    if (type.starts_with(no_file)) return {Value::Kind::any, {}};
  }
  return {Value::Kind::file, {}};
}

CompletedCommand completed(const CLI::App& app, const Words& path, const ChoicesByType& choices) {
  CompletedCommand out{path, app.get_description(), {}, {}, {}};
  for (const CLI::Option* option : app.get_options()) {
    if (!option->get_positional()) continue;
    const Value value = value_of(*option, choices);
    if (value.kind == Value::Kind::choice || out.positional.kind == Value::Kind::none) {
      out.positional = value;
    }
  }
  for (const CLI::Option* option : visible_options(app, false)) {
    CompletedOption each{{}, option->get_description(), value_of(*option, choices)};
    for (const std::string& name : option->get_snames()) each.names.push_back("-" + name);
    for (const std::string& name : option->get_lnames()) each.names.push_back("--" + name);
    out.options.push_back(std::move(each));
  }
  for (const CLI::App* command : visible_subcommands(app)) {
    Words below = path;
    below.push_back(command->get_name());
    out.commands.push_back(completed(*command, below, choices));
  }
  return out;
}

void for_each(const CompletedCommand& command,
              const std::function<void(const CompletedCommand&)>& action) {
  action(command);
  for (const CompletedCommand& below : command.commands) for_each(below, action);
}

/// A text as one word of any of the shells.
std::string shell_quoted(std::string_view text) {
  std::string out = "'";
  for (const char c : text) {
    if (c == '\'') {
      out += "'\\''";
    } else {
      out += c;
    }
  }
  return out + '\'';
}

Words command_names(const CompletedCommand& command) {
  Words out;
  for (const CompletedCommand& below : command.commands) out.push_back(below.path.back());
  return out;
}

/// Replaces every @NAME@ of a template.
std::string filled(std::string text, const std::vector<std::pair<std::string, std::string>>& with) {
  for (const auto& [name, value] : with) {
    const std::string place = "@" + name + "@";
    for (auto at = text.find(place); at != std::string::npos;
         at = text.find(place, at + value.size())) {
      text.replace(at, place.size(), value);
    }
  }
  return text;
}

// bash: one function. The words so far select the command; then either the option before the cursor
// requires a value, or one of the command's own words is completed.

constexpr const char* bash_template =
    R"(# Completion of @PROGRAM@ for bash, as `@PROGRAM@ completion bash` prints it.
_@PROGRAM@() {
  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]}
  local command= options= choices= files= i
  # bash splits --option=value into three words.
  if [[ $word == = ]]; then
    word=
  elif [[ $before == = ]]; then
    before=${COMP_WORDS[COMP_CWORD - 2]}
  fi
  for ((i = 1; i < COMP_CWORD; i++)); do
    case "$command ${COMP_WORDS[i]}" in
      @COMMANDS@)
        command="${command:+$command }${COMP_WORDS[i]}" ;;
    esac
  done
  case "$command $before" in
@VALUES@    *)
      case "$command" in
@WORDS@      esac
      [[ $word != -* ]] || { choices=$options; files=; } ;;
  esac
  mapfile -t COMPREPLY < <(compgen -W "$choices" -- "$word")
  if [[ $files == yes ]]; then
    compopt -o filenames 2>/dev/null
    mapfile -t -O ${#COMPREPLY[@]} COMPREPLY < <(compgen -f -- "$word")
  fi
}
complete -F _@PROGRAM@ @PROGRAM@
)";

/// Case pattern of a command: the path above it, a blank, its name.
std::string bash_command_pattern(const CompletedCommand& command) {
  const Words above(command.path.begin(), command.path.end() - 1);
  return shell_quoted(joined(above, " ") + " " + command.path.back());
}

/// Cases that set `choices` or `files` for the value of an option of a command.
std::string bash_value_cases(const CompletedCommand& command) {
  std::string out;
  for (const CompletedOption& option : command.options) {
    if (option.value.kind == Value::Kind::none) continue;
    Words patterns;
    for (const std::string& name : option.names) {
      patterns.push_back(shell_quoted(joined(command.path, " ") + " " + name));
    }
    out += "    " + joined(patterns, " | ") + ") ";
    if (option.value.kind == Value::Kind::choice) {
      out += "choices=" + shell_quoted(joined(option.value.choices, " "));
    } else {
      out += option.value.kind == Value::Kind::file ? "files=yes" : ":";
    }
    out += " ;;\n";
  }
  return out;
}

/// Case that sets the options, the subcommands or positional values of a command.
std::string bash_word_case(const CompletedCommand& command) {
  Words options;
  for (const CompletedOption& option : command.options) {
    options.insert(options.end(), option.names.begin(), option.names.end());
  }
  const bool listed = command.positional.kind == Value::Kind::choice;
  return "    " + shell_quoted(joined(command.path, " ")) +
         ") options=" + shell_quoted(joined(options, " ")) + " choices=" +
         shell_quoted(joined(listed ? command.positional.choices : command_names(command), " ")) +
         (command.positional.kind == Value::Kind::file ? " files=yes" : "") + " ;;\n";
}

std::string bash_script(const std::string& name, const CompletedCommand& program) {
  std::string commands;
  std::string values;
  std::string words;
  for_each(program, [&](const CompletedCommand& command) {
    if (!command.path.empty()) {
      commands += (commands.empty() ? "" : " |\\\n      ") + bash_command_pattern(command);
    }
    values += bash_value_cases(command);
    words += bash_word_case(command);
  });
  return filled(bash_template,
                {{"PROGRAM", name}, {"COMMANDS", commands}, {"VALUES", values}, {"WORDS", words}});
}

// zsh: one function per command, each with its own _arguments.

/// A text within [...] or behind a colon of an _arguments specification.
std::string zsh_text(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

std::string zsh_action(const Value& value) {
  switch (value.kind) {
    case Value::Kind::none:
      return "";
    case Value::Kind::choice:
      return ":value:(" + joined(value.choices, " ") + ")";
    case Value::Kind::file:
      return ":file:_files";
    case Value::Kind::any:
      return ":value: ";
  }
  return "";
}

std::string zsh_function_name(const std::string& program, const Words& path) {
  return "_" + program + std::string(path.empty() ? "" : "_") + joined(path, "_");
}

/// One specification per name; the names of an option exclude each other.
std::string zsh_option(const CompletedOption& option) {
  std::string out;
  const std::string except = option.names.size() > 1 ? "(" + joined(option.names, " ") + ")" : "";
  for (const std::string& name : option.names) {
    const bool assignable = option.value.kind != Value::Kind::none && name.starts_with("--");
    out +=
        " \\\n    " + shell_quoted(except + name + (assignable ? "=" : "") + "[" +
                                   zsh_text(option.description) + "]" + zsh_action(option.value));
  }
  return out;
}

/// The dispatch of a command to the functions of its subcommands.
std::string zsh_subcommands(const std::string& program, const CompletedCommand& command) {
  std::string out =
      " \\\n    '1:command:->command' '*::argument:->argument'\n  case $state in\n"
      "    command)\n      local -a commands=(";
  for (const CompletedCommand& below : command.commands) {
    out += "\n        " +
           shell_quoted(zsh_text(below.path.back()) + ":" + zsh_text(below.description));
  }
  out +=
      ")\n      _describe -t commands command commands ;;\n    argument)\n"
      "      case $line[1] in\n";
  for (const CompletedCommand& below : command.commands) {
    out += "        " + below.path.back() + ") " + zsh_function_name(program, below.path) + " ;;\n";
  }
  return out + "      esac ;;\n  esac\n";
}

std::string zsh_function(const std::string& program, const CompletedCommand& command) {
  const bool branches = !command.commands.empty();
  std::string out = "\n" + zsh_function_name(program, command.path) + "() {\n";
  if (branches) out += "  local state line\n  typeset -A opt_args\n";
  out += branches ? "  _arguments -C" : "  _arguments";
  for (const CompletedOption& option : command.options) out += zsh_option(option);
  if (branches) return out + zsh_subcommands(program, command) + "}\n";
  if (command.positional.kind != Value::Kind::none) {
    out += " \\\n    " + shell_quoted("*" + zsh_action(command.positional));
  }
  return out + "\n}\n";
}

std::string zsh_script(const std::string& name, const CompletedCommand& program) {
  std::string out = "#compdef " + name + "\n# Completion of " + name + " for zsh, as `" + name +
                    " completion zsh` prints it.\n";
  for_each(program, [&](const CompletedCommand& command) { out += zsh_function(name, command); });
  return out + filled(
                   "\nif [[ $funcstack[1] == _@PROGRAM@ ]]; then\n"
                   "  _@PROGRAM@ \"$@\"\n"
                   "else\n"
                   "  compdef _@PROGRAM@ @PROGRAM@\n"
                   "fi\n",
                   {{"PROGRAM", name}});
}

// fish: one line per word.

std::string fish_value(const Value& value) {
  switch (value.kind) {
    case Value::Kind::none:
      return "";
    case Value::Kind::choice:
      return " -x -a " + shell_quoted(joined(value.choices, " "));
    case Value::Kind::file:
      return " -r -F";
    case Value::Kind::any:
      return " -x";
  }
  return "";
}

/// The condition under which the words of a command are offered.
std::string fish_condition(const CompletedCommand& command) {
  if (command.path.empty()) return "__fish_use_subcommand";
  std::string out;
  for (const std::string& word : command.path) {
    out += (out.empty() ? "" : "; and ") + ("__fish_seen_subcommand_from " + word);
  }
  if (!command.commands.empty()) {
    out += "; and not __fish_seen_subcommand_from " + joined(command_names(command), " ");
  }
  return out;
}

std::string fish_lines(const std::string& program, const CompletedCommand& command) {
  const std::string begin =
      "complete -c " + program + " -n " + shell_quoted(fish_condition(command));
  std::string out;
  for (const CompletedCommand& below : command.commands) {
    out += begin + " -a " + shell_quoted(below.path.back()) + " -d " +
           shell_quoted(below.description) + "\n";
  }
  if (command.positional.kind == Value::Kind::file) {
    out += begin + " -F\n";
  } else if (command.positional.kind == Value::Kind::choice) {
    out += begin + " -a " + shell_quoted(joined(command.positional.choices, " ")) + "\n";
  }
  for (const CompletedOption& option : command.options) {
    out += begin;
    for (const std::string& name : option.names) {
      out += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
    }
    out += fish_value(option.value) + " -d " + shell_quoted(option.description) + "\n";
  }
  return out;
}

std::string fish_script(const std::string& name, const CompletedCommand& program) {
  std::string out = "# Completion of " + name + " for fish, as `" + name +
                    " completion fish` prints it.\ncomplete -c " + name + " -f\n";
  for_each(program, [&](const CompletedCommand& command) { out += fish_lines(name, command); });
  return out;
}

}  // namespace

std::string completion_script(Shell shell, const CLI::App& program, const ChoicesByType& choices) {
  const std::string name = program.get_name();
  const CompletedCommand root = completed(program, {}, choices);
  switch (shell) {
    case Shell::bash:
      return bash_script(name, root);
    case Shell::zsh:
      return zsh_script(name, root);
    case Shell::fish:
      return fish_script(name, root);
  }
  return "";
}

}  // namespace stickslip::terminal
