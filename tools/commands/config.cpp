// SPDX-License-Identifier: Apache-2.0
// `stickslip config`: the effective settings of a rig, with defaults and origins.
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "config/document.h"
#include "config/key.h"
#include "config/rig.h"
#include "config/settings.h"
#include "physics/problem.h"
#include "physics/spelling.h"
#include "protocol/json_text.h"
#include "tools/command_line/file_options.h"
#include "tools/command_line/shared_options.h"
#include "tools/commands/commands.h"
#include "tools/terminal/page.h"

namespace stickslip::commands {

using namespace command_line;
namespace {

using config::Setting;

struct Arguments {
  std::string file;
  std::string key;
  bool explain = false;
  bool json = false;
};

std::string origin(const Setting& setting, const std::string& file) {
  return setting.stated() ? file + ":" + std::to_string(setting.line) : "default";
}

/// Settings of a key or of all keys of a table; all if `asked` is empty. Throws InputError if there
/// are none.
std::vector<Setting> chosen(const std::vector<Setting>& settings, const std::string& asked) {
  std::vector<Setting> out;
  for (const Setting& each : settings) {
    const bool within = asked.empty() || each.path == asked || each.path.starts_with(asked + ".");
    if (within) out.push_back(each);
  }
  if (!out.empty()) return out;
  std::vector<std::string> names;
  for (const Setting& each : settings) names.push_back(each.path);
  const std::string meant = physics::nearest(asked, names);
  throw InputError(Problem{"", 0, 0,
                           "config: there is no key \"" + asked + "\"" +
                               (meant.empty() ? "; `stickslip check --keys` lists them"
                                              : ": did you mean " + meant + "?")});
}

/// "number [Hz], above 0 to 1000".
std::string kind_of_value(const config::Key& key) {
  std::string text(name_of(key.type));
  const bool unit = !key.unit.empty() && key.unit != "1";
  if (unit) text += " [" + std::string(key.unit) + "]";
  const std::string range = config::range_of(key);
  if (!range.empty()) text += ", " + range;
  return text;
}

/// Comment lines, continued by comment lines, so that the page remains TOML.
std::string as_comment(const std::string& text, std::size_t columns) {
  std::string out;
  std::istringstream lines(terminal::fitted(text, columns > 2 ? columns - 2 : 0));
  for (std::string line; std::getline(lines, line);) out += "# " + line + '\n';
  return out;
}

/// The rig as one file, with the defaults as comments. A key and its value stay on one line,
/// however long; the origin is on a line of its own where there is no room for it.
void print_values(const std::vector<Setting>& settings, const std::string& file) {
  const std::size_t columns = terminal::page_columns(STDOUT_FILENO);
  for (const Setting& each : settings) {
    if (each.value.empty()) {
      std::fputs(as_comment(each.path + ": " + each.words, columns).c_str(), stdout);
      continue;
    }
    const std::string setting = (each.stated() ? "" : "# ") + each.path + " = " + each.value;
    const std::string from = origin(each, file);
    const std::string line = setting + "  # " + from + '\n';
    const bool fits = columns == 0 || line.size() <= columns + 1;
    std::fputs((fits ? line : as_comment(from, columns) + setting + '\n').c_str(), stdout);
  }
}

void print_explained(const std::vector<Setting>& settings, const std::string& file) {
  const char* between = "";
  for (const Setting& each : settings) {
    const config::Key& key = *each.key;
    const std::string value = each.value.empty() ? "(" + each.words + ")" : each.value;
    terminal::print("%s%s = %s\n", between, each.path.c_str(), value.c_str());
    terminal::print("  from        %s\n", origin(each, file).c_str());
    terminal::print("  meaning     %.*s\n", static_cast<int>(key.sentence.size()),
                    key.sentence.data());
    terminal::print("  type        %s\n", kind_of_value(key).c_str());
    terminal::print("  without it  %s\n", config::absence_of(key).c_str());
    terminal::print("  change      %s\n", key.live ? "live: a running daemon applies it on SIGHUP"
                                                   : "needs a restart of the daemon");
    between = "\n";
  }
}

nlohmann::ordered_json as_json(const std::vector<Setting>& settings, const std::string& file) {
  nlohmann::ordered_json keys = nlohmann::ordered_json::array();
  const auto bound = [](double value) {
    return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json();
  };
  for (const Setting& each : settings) {
    const config::Key& key = *each.key;
    nlohmann::ordered_json entry;
    entry["key"] = each.path;
    entry["toml"] =
        each.value.empty() ? nlohmann::ordered_json() : nlohmann::ordered_json(each.value);
    entry["words"] = each.words;
    entry["stated"] = each.stated();
    entry["line"] = each.stated() ? nlohmann::ordered_json(each.line) : nlohmann::ordered_json();
    entry["type"] = name_of(key.type);
    entry["unit"] = key.unit;
    entry["minimum"] = bound(key.low);
    entry["minimum_excluded"] = key.above_low;
    entry["maximum"] = bound(key.high);
    entry["choices"] = std::vector<std::string_view>(key.choices.begin(), key.choices.end());
    entry["without_it"] = config::absence_of(key);
    entry["live"] = key.live;
    entry["sentence"] = key.sentence;
    keys.push_back(std::move(entry));
  }
  return {{"schema", 1}, {"file", file}, {"keys", std::move(keys)}};
}

int run(const Arguments& arguments) {
  config::Rig rig = config::load_rig(arguments.file);
  // Paths that are valid for the output in any folder.
  rig.file = std::filesystem::absolute(rig.file);
  const std::vector<Setting> settings = chosen(config::settings_of(rig), arguments.key);
  if (arguments.json) {
    std::printf("%s\n", protocol::json_text(as_json(settings, arguments.file)).c_str());
  } else if (arguments.explain) {
    print_explained(settings, arguments.file);
  } else {
    print_values(settings, arguments.file);
  }
  return 0;
}

}  // namespace

void add_config(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "config", "Print all settings of a rig with defaults, and the origin of each value");
  add_input(*command, "RIG", arguments->file, "Rig (TOML)")
      ->required()
      ->transform(shipped_file(""));
  CLI::Option* explain =
      command
          ->add_option(
              "--explain", arguments->key,
              "Explain each key: meaning, unit, range, and whether a running daemon applies "
              "a change; only KEY, or the keys of a table, if given")
          ->type_name("KEY")
          ->expected(0, 1);
  add_json_flag(*command, arguments->json);
  command->callback([&action, arguments, explain] {
    arguments->explain = explain->count() > 0;
    action = [arguments] { return run(*arguments); };
  });
  describe(
      *command,
      {.examples = {{"Explain one key: its value, its meaning, and the origin of the value",
                     "stickslip config config/simulated.toml --explain excitation.carrier_hz"}},
       .see_also = {"stickslip-check(1)"}});
}

}  // namespace stickslip::commands
