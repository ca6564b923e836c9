// `stickslip`: the command-line tools around the daemon.
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <optional>
#include <stdexcept>
#include <string>

#include "physics/problem.h"
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
  describe(app,
           {.examples = {{"Check a rig file offline", "stickslip check config/simulated.toml"},
                         {"Show the traffic on LCM", "stickslip spy"},
                         {"Identify physics that a model omits",
                          "stickslip diagnose run.log --model model.toml --html report.html"}},
            .environment = {no_color_variable},
            .files = {{"/etc/stickslip", "Rig files of an installation"},
                      {"/run/stickslip/control.sock",
                       "Socket on which the daemon receives the commands of stickslip ctl"}},
            .description =
                "On a terminal, commands that run longer than a second show their progress and the "
                "time remaining on standard error; in a pipe they are silent.",
            .see_also = {"stickslipd(8)"}});
}

/// True if the first argument is an option or the name of a subcommand; otherwise prints the names.
bool names_subcommand(const CLI::App& app, int argc, char** argv) {
  std::string known;
  bool is_known = false;
  for (const CLI::App* each : app.get_subcommands([](const CLI::App*) { return true; })) {
    is_known = is_known || (argc > 1 && each->get_name() == argv[1]);
    known += (known.empty() ? "" : ", ") + each->get_name();
  }
  if (argc >= 2 && (argv[1][0] == '-' || is_known)) return true;
  const std::string error =
      argc < 2 ? "no command is given" : "there is no command \"" + std::string(argv[1]) + "\"";
  std::fprintf(stderr, "stickslip: %s; expected one of %s\n", error.c_str(), known.c_str());
  return false;
}

/// Exit status of the parser if there is nothing to run: --help, --version, or an error.
std::optional<int> parse(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    std::fprintf(stderr, "stickslip: %s (see --help)\n", error.what());
    return 2;
  }
  return std::nullopt;
}

/// Throws std::runtime_error if buffered output could not be written.
void flush_output() {
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    throw std::runtime_error(std::string("standard output cannot be written: ") +
                             std::strerror(errno));
  }
}

int run(int argc, char** argv) {
  Program app{"Tools for a dry-friction oscillator rig: simulate, record, replay, diagnose.",
              "stickslip"};
  Action action;
  describe_program(app);
  add_subcommands(app, action);
  if (!names_subcommand(app, argc, argv)) return 2;
  if (const std::optional<int> status = parse(app, argc, argv)) return *status;
  const Action chosen = action;  // a copy: `manual` parses its examples, which sets it again
  const int status = chosen();
  flush_output();
  return status;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const stickslip::InputError& error) {
    std::fprintf(stderr, "stickslip: %s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "stickslip: %s\n", error.what());
    return 1;
  }
}
