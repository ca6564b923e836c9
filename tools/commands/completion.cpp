// `stickslip completion`: what a shell needs to complete the commands, made from the parser itself,
// so that it knows every option that there is.
#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "config/key.h"
#include "tools/commands/commands.h"

namespace stickslip::commands {
namespace {

using Words = std::vector<std::string>;

/// What may follow an option, or stand in a place of its own.
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

/// A command, or one of its commands: `path` is the words that lead to it, empty for the program.
struct CompletedCommand {
  Words path;
  std::string description;
  std::vector<CompletedOption> options;
  Value positional;  ///< what its places of its own take, all together
  std::vector<CompletedCommand> commands;
};

Words split(std::string_view list, char at) {
  Words out;
  while (!list.empty()) {
    const auto comma = list.find(at);
    out.emplace_back(list.substr(0, comma));
    list = comma == std::string_view::npos ? std::string_view{} : list.substr(comma + 1);
  }
  return out;
}

std::string joined(const Words& words, std::string_view between) {
  std::string out;
  for (const std::string& word : words) out += (out.empty() ? "" : std::string(between)) + word;
  return out;
}

Value value_of(const CLI::Option& option) {
  if (option.get_items_expected_max() == 0) return {};
  const std::string type = option.get_type_name();  // with the words of its checks
  // A check that knows the choices lists them: {csv,lcm}.
  const auto open = type.find('{');
  const auto close = type.find('}', open);
  if (open != std::string::npos && close != std::string::npos) {
    return {Value::Kind::choice, split(type.substr(open + 1, close - open - 1), ',')};
  }
  if (type == "KEY") {
    Words keys;
    for (const config::Key& key : config::rig_keys()) {
      if (key.path.find('*') == std::string_view::npos) keys.emplace_back(key.path);
    }
    return {Value::Kind::choice, keys};
  }
  for (const char* no_file : {"FLOAT", "INT", "UINT", "NAME"}) {
    if (type.starts_with(no_file)) return {Value::Kind::any, {}};
  }
  return {Value::Kind::file, {}};
}

CompletedCommand read(const CLI::App& app, const Words& path) {
  CompletedCommand out{path, app.get_description(), {}, {}, {}};
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_positional()) {
      const Value value = value_of(*option);
      if (value.kind == Value::Kind::choice || out.positional.kind == Value::Kind::none) {
        out.positional = value;
      }
      continue;
    }
    if (option->get_group().empty()) continue;  // hidden
    CompletedOption each{{}, option->get_description(), value_of(*option)};
    for (const std::string& name : option->get_snames()) each.names.push_back("-" + name);
    for (const std::string& name : option->get_lnames()) each.names.push_back("--" + name);
    out.options.push_back(std::move(each));
  }
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (command->get_group().empty()) continue;
    Words below = path;
    below.push_back(command->get_name());
    out.commands.push_back(read(*command, below));
  }
  return out;
}

void for_each(const CompletedCommand& command,
              const std::function<void(const CompletedCommand&)>& action) {
  action(command);
  for (const CompletedCommand& below : command.commands) for_each(below, action);
}

/// A text as one word of any of the shells.
std::string as_word(std::string_view text) {
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

// bash: one function. The words so far say which command it is, then either the option before the
// cursor wants a value, or one of the command's own words is completed.

std::string bash_script(const CompletedCommand& program) {
  std::string known;
  std::string values;
  std::string words;
  for_each(program, [&](const CompletedCommand& command) {
    const std::string path = joined(command.path, " ");
    if (!path.empty()) {
      const std::string above = joined(Words(command.path.begin(), command.path.end() - 1), " ");
      known += (known.empty() ? "" : " |\\\n      ") + as_word(above + " " + command.path.back());
    }
    Words options;
    for (const CompletedOption& option : command.options) {
      Words patterns;
      for (const std::string& name : option.names) {
        options.push_back(name);
        patterns.push_back(as_word(path + " " + name));
      }
      if (option.value.kind == Value::Kind::none) continue;
      values += "    " + joined(patterns, " | ") + ") ";
      switch (option.value.kind) {
        case Value::Kind::choice:
          values += "choices=" + as_word(joined(option.value.choices, " "));
          break;
        case Value::Kind::file:
          values += "files=yes";
          break;
        default:
          values += ":";
          break;
      }
      values += " ;;\n";
    }
    Words own = command_names(command);
    if (command.positional.kind == Value::Kind::choice) own = command.positional.choices;
    words += "    " + as_word(path) + ") options=" + as_word(joined(options, " ")) +
             " choices=" + as_word(joined(own, " ")) +
             (command.positional.kind == Value::Kind::file ? " files=yes" : "") + " ;;\n";
  });
  return "# Completion of stickslip for bash, as `stickslip completion bash` prints it.\n"
         "_stickslip() {\n"
         "  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]}\n"
         "  local command= options= choices= files= i\n"
         "  # bash takes --option=value for three words.\n"
         "  if [[ $word == = ]]; then\n"
         "    word=\n"
         "  elif [[ $before == = ]]; then\n"
         "    before=${COMP_WORDS[COMP_CWORD - 2]}\n"
         "  fi\n"
         "  for ((i = 1; i < COMP_CWORD; i++)); do\n"
         "    case \"$command ${COMP_WORDS[i]}\" in\n"
         "      " +
         known +
         ")\n"
         "        command=\"${command:+$command }${COMP_WORDS[i]}\" ;;\n"
         "    esac\n"
         "  done\n"
         "  case \"$command $before\" in\n" +
         values +
         "    *)\n"
         "      case \"$command\" in\n" +
         words +
         "      esac\n"
         "      [[ $word != -* ]] || { choices=$options; files=; } ;;\n"
         "  esac\n"
         "  mapfile -t COMPREPLY < <(compgen -W \"$choices\" -- \"$word\")\n"
         "  if [[ $files == yes ]]; then\n"
         "    compopt -o filenames 2>/dev/null\n"
         "    mapfile -t -O ${#COMPREPLY[@]} COMPREPLY < <(compgen -f -- \"$word\")\n"
         "  fi\n"
         "}\n"
         "complete -F _stickslip stickslip\n";
}

// zsh: a function for each command, on its own _arguments.

/// A text within [...] or behind a colon of a specification of _arguments.
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

std::string zsh_script(const CompletedCommand& program) {
  std::string out =
      "#compdef stickslip\n"
      "# Completion of stickslip for zsh, as `stickslip completion zsh` prints it.\n";
  const auto function_of = [](const Words& path) {
    return "_stickslip" + std::string(path.empty() ? "" : "_") + joined(path, "_");
  };
  for_each(program, [&](const CompletedCommand& command) {
    out += "\n" + function_of(command.path) + "() {\n";
    const bool branches = !command.commands.empty();
    if (branches) out += "  local state line\n  typeset -A opt_args\n";
    out += branches ? "  _arguments -C" : "  _arguments";
    for (const CompletedOption& option : command.options) {
      for (const std::string& name : option.names) {
        // --name=value and --name value; all names of an option exclude each other.
        const bool takes = option.value.kind != Value::Kind::none;
        const std::string except =
            option.names.size() > 1 ? "(" + joined(option.names, " ") + ")" : "";
        out += " \\\n    " +
               as_word(except + name + (takes && name.starts_with("--") ? "=" : "") + "[" +
                       zsh_text(option.description) + "]" + zsh_action(option.value));
      }
    }
    if (branches) {
      out +=
          " \\\n    '1:command:->command' '*::argument:->argument'\n  case $state in\n"
          "    command)\n      local -a commands=(";
      for (const CompletedCommand& below : command.commands) {
        out +=
            "\n        " + as_word(zsh_text(below.path.back()) + ":" + zsh_text(below.description));
      }
      out +=
          ")\n      _describe -t commands command commands ;;\n    argument)\n"
          "      case $line[1] in\n";
      for (const CompletedCommand& below : command.commands) {
        out += "        " + below.path.back() + ") " + function_of(below.path) + " ;;\n";
      }
      out += "      esac ;;\n  esac\n";
    } else {
      if (command.positional.kind != Value::Kind::none) {
        out += " \\\n    " + as_word("*" + zsh_action(command.positional));
      }
      out += "\n";
    }
    out += "}\n";
  });
  return out +
         "\nif [[ $funcstack[1] == _stickslip ]]; then\n"
         "  _stickslip \"$@\"\n"
         "else\n"
         "  compdef _stickslip stickslip\n"
         "fi\n";
}

// fish: one line for each word.

std::string fish_value(const Value& value) {
  switch (value.kind) {
    case Value::Kind::none:
      return "";
    case Value::Kind::choice:
      return " -x -a " + as_word(joined(value.choices, " "));
    case Value::Kind::file:
      return " -r -F";
    case Value::Kind::any:
      return " -x";
  }
  return "";
}

std::string fish_script(const CompletedCommand& program) {
  std::string out =
      "# Completion of stickslip for fish, as `stickslip completion fish` prints it.\n"
      "complete -c stickslip -f\n";
  for_each(program, [&](const CompletedCommand& command) {
    std::string here;
    for (const std::string& word : command.path) {
      here += (here.empty() ? "" : "; and ") + ("__fish_seen_subcommand_from " + word);
    }
    std::string before = here.empty() ? "__fish_use_subcommand" : here;
    if (!here.empty() && !command.commands.empty()) {
      before += "; and not __fish_seen_subcommand_from " + joined(command_names(command), " ");
    }
    for (const CompletedCommand& below : command.commands) {
      out += "complete -c stickslip -n " + as_word(before) + " -a " + as_word(below.path.back()) +
             " -d " + as_word(below.description) + "\n";
    }
    if (command.positional.kind == Value::Kind::file) {
      out += "complete -c stickslip -n " + as_word(before) + " -F\n";
    } else if (command.positional.kind == Value::Kind::choice) {
      out += "complete -c stickslip -n " + as_word(before) + " -a " +
             as_word(joined(command.positional.choices, " ")) + "\n";
    }
    for (const CompletedOption& option : command.options) {
      out += "complete -c stickslip -n " + as_word(before);
      for (const std::string& name : option.names) {
        out += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
      }
      out += fish_value(option.value) + " -d " + as_word(option.description) + "\n";
    }
  });
  return out;
}

}  // namespace

void add_completion(CLI::App& app, Action& action) {
  auto shell = std::make_shared<std::string>();
  CLI::App* command =
      app.add_subcommand("completion", "Print what a shell needs to complete these commands");
  command->add_option("SHELL", *shell, "For which shell")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}));
  command->footer(
      "Installed with the program. To try it from the build: source <(stickslip completion bash)");
  command->callback([&app, &action, shell] {
    action = [&app, shell] {
      const CompletedCommand program = read(app, {});
      const std::string script = *shell == "bash"  ? bash_script(program)
                                 : *shell == "zsh" ? zsh_script(program)
                                                   : fish_script(program);
      std::fputs(script.c_str(), stdout);
      return 0;
    };
  });
}

}  // namespace stickslip::commands
