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
#include "physics/problem.h"
#include "tools/commands/commands.h"
#include "tools/terminal/page.h"

namespace stickslip::commands {

namespace {

struct Arguments {
  std::string id;
  bool markdown = false;
  bool svg = false;
};

/// Throws InputError, with the id that is probably meant, if there is no such effect.
const physics::Effect& effect_of(const std::string& id) {
  if (const physics::Effect* effect = physics::find_effect(id)) return *effect;
  const std::string meant = physics::nearest_effect(id);
  throw InputError(Problem{id, 0, 0,
                           meant.empty() ? "is no effect; `stickslip effects` lists them"
                                         : "is no effect; did you mean \"" + meant + "\"?"});
}

std::size_t text_columns() {
  const std::size_t columns = terminal::page_columns(STDOUT_FILENO);
  return columns == 0 ? 80 : std::clamp<std::size_t>(columns, 20, 100);
}

int run(const Arguments& arguments) {
  // Documents and pictures go into files, whose lines are no page's.
  if (arguments.markdown) {
    std::fputs(report::effects_page().c_str(), stdout);
  } else if (arguments.svg) {
    std::fputs(report::effect_picture(effect_of(arguments.id)).c_str(), stdout);
  } else {
    terminal::print_page(arguments.id.empty()
                             ? report::effects_list()
                             : report::effect_text(effect_of(arguments.id), text_columns()));
  }
  return 0;
}

}  // namespace

void add_effects(CLI::App& app, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "effects",
      "List the effects of the catalogue, or explain one: formula, parameters, references");
  CLI::Option* id =
      command->add_option("ID", arguments->id, "Effect to explain")->type_name("EFFECT");
  CLI::Option* svg =
      command->add_flag("--svg", arguments->svg, "Print the picture of the effect")->needs(id);
  command
      ->add_flag("--markdown", arguments->markdown, "Print the whole catalogue as docs/effects.md")
      ->excludes(id)
      ->excludes(svg);
  command->callback([&action, arguments] { action = [arguments] { return run(*arguments); }; });
  describe(*command, {.examples = {{"List all effects", "stickslip effects"},
                                   {"Explain one", "stickslip effects stribeck"},
                                   {"Draw its law", "stickslip effects stribeck --svg"}},
                      .see_also = {"stickslip-diagnose(1)", "stickslip-check(1)"}});
}

}  // namespace stickslip::commands
