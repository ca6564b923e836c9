// SPDX-License-Identifier: Apache-2.0
// `stickslip completion`: shell completion, generated from the parser.
#include "tools/terminal/completion.h"

#include <cstdio>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "config/key.h"
#include "physics/catalogue.h"
#include "physics/friction_laws.h"
#include "tools/command_line/option_checks.h"
#include "tools/commands/commands.h"

namespace stickslip::commands {

using namespace command_line;

using namespace terminal;

namespace {

/// Keys of a rig file that stand for one value.
std::vector<std::string> plain_keys() {
  std::vector<std::string> out;
  for (const config::Key& key : config::rig_keys()) {
    if (key.path.find('*') == std::string_view::npos) out.emplace_back(key.path);
  }
  return out;
}

/// Of effects and of laws of friction; some are both.
std::vector<std::string> effect_ids() {
  std::set<std::string> out;
  for (const physics::Effect* effect : physics::catalogue()) out.emplace(effect->card().id);
  for (const physics::Effect* law : physics::friction_laws()) out.emplace(law->card().id);
  return {out.begin(), out.end()};
}

}  // namespace

void add_completion(CLI::App& app, Action& action) {
  const std::map<std::string, Shell> shells = {
      {"bash", Shell::bash}, {"zsh", Shell::zsh}, {"fish", Shell::fish}};
  auto shell = std::make_shared<std::string>();
  CLI::App* command =
      app.add_subcommand("completion", "Print a script that completes these commands in a shell");
  command->add_option("SHELL", *shell, "Shell that sources the script")
      ->required()
      ->check(one_of({"bash", "zsh", "fish"}));
  command->footer(
      "Installed with the program. To try it from the build: source <(stickslip completion bash)");
  command->callback([&app, &action, shell, shells] {
    action = [&app, chosen = shells.at(*shell)] {
      std::fputs(
          completion_script(chosen, app, {{"KEY", plain_keys()}, {"EFFECT", effect_ids()}}).c_str(),
          stdout);
      return 0;
    };
  });
  describe(*command, {.examples = {{"Completion for bash", "stickslip completion bash"}},
                      .see_also = {"stickslip-manual(1)"}});
}

}  // namespace stickslip::commands
