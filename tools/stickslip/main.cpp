// SPDX-License-Identifier: Apache-2.0
// `stickslip`: the command-line tools around the daemon.
#include <algorithm>

#include "tools/command_line/run.h"
#include "tools/commands/commands.h"

namespace {

using stickslip::command_line::Program;
using namespace stickslip::commands;

void describe_program(Program& app) {
  app.set_version_flag("--version", "stickslip " STICKSLIP_VERSION);
  app.require_subcommand(1);
  app.footer(
      "Exit status: 0 success, whatever the verdict; 2 invalid arguments or input; 1 other "
      "failures.");
  describe(
      app,
      {.examples = {{"Check a rig file offline", "stickslip check config/simulated.toml"},
                    {"Show the traffic on LCM", "stickslip spy"},
                    {"Identify physics that a model omits",
                     "stickslip diagnose run.log --model model.toml --html report.html"}},
       .environment = {no_color_variable},
       .files = {{"/etc/stickslip", "Rig files of an installation"},
                 {"PREFIX/share/stickslip",
                  "Rigs, models and fault scripts that are shipped; commands find them by name"},
                 {"/run/stickslip/control.sock",
                  "Socket on which the daemon receives the commands of stickslip ctl"}},
       .description =
           "On a terminal, commands that run longer than a second show their progress and the "
           "time remaining on standard error; in a pipe they are silent.",
       .see_also = {"stickslipd(8)"}});
}

}  // namespace

int main(int argc, char** argv) {
  Program app{"Tools for a dry-friction oscillator rig: simulate, record, replay, diagnose.",
              "stickslip"};
  Action action;
  describe_program(app);
  add_subcommands(app, action);
  return stickslip::command_line::run(app, action, {argv + 1, argv + std::max(1, argc)});
}
