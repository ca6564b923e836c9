// SPDX-License-Identifier: Apache-2.0
// `stickslip effects`: the catalogue of effects.
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "diagnosis/report/effect_picture.h"
#include "diagnosis/report/effects_page.h"
#include "physics/catalogue.h"
#include "physics/friction_laws.h"
#include "physics/problem.h"
#include "physics/spelling.h"
#include "tools/commands/commands.h"
#include "tools/terminal/page.h"

namespace stickslip::commands {

namespace {

struct Arguments {
  std::string id;
  bool markdown = false;
  bool svg = false;
};

/// Throws InputError, with the id that is probably meant, for an id of neither an effect nor a law.
void check_id(const std::string& id) {
  std::vector<std::string> ids;
  for (const physics::Effect* effect : physics::catalogue()) ids.emplace_back(effect->card().id);
  for (const physics::Effect* law : physics::friction_laws()) ids.emplace_back(law->card().id);
  if (std::find(ids.begin(), ids.end(), id) != ids.end()) return;
  const std::string meant = physics::nearest(id, ids);
  throw InputError(Problem{id, 0, 0,
                           meant.empty() ? "is no effect; `stickslip effects` lists them"
                                         : "is no effect; did you mean \"" + meant + "\"?"});
}

std::size_t text_columns() {
  const std::size_t columns = terminal::page_columns(STDOUT_FILENO);
  return columns == 0 ? 80 : std::clamp<std::size_t>(columns, 20, 100);
}

/// The effect, and the law of friction of the same id.
std::string explanation_of(const std::string& id) {
  const physics::Effect* effect = physics::find_effect(id);
  const physics::Effect* law = physics::find_law(id);
  std::string out = effect != nullptr ? report::effect_text(*effect, text_columns()) : "";
  if (effect != nullptr && law != nullptr) out += "\nAlso a law of friction:\n\n";
  return law != nullptr ? out + report::effect_text(*law, text_columns()) : out;
}

std::string picture_of(const std::string& id) {
  const physics::Effect* effect = physics::find_effect(id);
  if (effect != nullptr) return report::effect_picture(*effect);
  throw InputError(Problem{id, 0, 0, "is a law of friction, which `stickslip laws --html` draws"});
}

int run(const Arguments& arguments) {
  if (!arguments.id.empty()) check_id(arguments.id);
  // Documents and pictures go into files, whose lines are no page's.
  if (arguments.markdown) {
    std::fputs(report::effects_page().c_str(), stdout);
  } else if (arguments.svg) {
    std::fputs(picture_of(arguments.id).c_str(), stdout);
  } else {
    terminal::print_page(arguments.id.empty() ? report::effects_list()
                                              : explanation_of(arguments.id));
  }
  return 0;
}

}  // namespace

void add_effects(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "effects", "List the effects of the catalogue and the laws of friction, or explain one");
  CLI::Option* id = command
                        ->add_option("ID", arguments->id,
                                     "Effect or law to explain: formula, parameters, references")
                        ->type_name("EFFECT");
  CLI::Option* svg =
      command->add_flag("--svg", arguments->svg, "Print the picture of the effect")->needs(id);
  command
      ->add_flag("--markdown", arguments->markdown, "Print the whole catalogue as docs/effects.md")
      ->excludes(id)
      ->excludes(svg);
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
  describe(*command,
           {.examples = {{"List all effects", "stickslip effects"},
                         {"Explain one", "stickslip effects end_stop"},
                         {"Explain a law of friction", "stickslip effects lugre"},
                         {"Draw its law", "stickslip effects end_stop --svg"}},
            .see_also = {"stickslip-diagnose(1)", "stickslip-laws(1)", "stickslip-model(1)"}});
}

}  // namespace stickslip::commands
