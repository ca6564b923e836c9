// `stickslip`: the tools around the daemon, one file or folder per subcommand.
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <stdexcept>
#include <string>

#include "physics/problem.h"
#include "tools/commands/commands.h"

namespace {

int run(int argc, char** argv) {
  using namespace stickslip::commands;
  CLI::App app{"Tools for a dry-friction oscillator rig: simulate, record, replay, diagnose.",
               "stickslip"};
  app.set_version_flag("--version", "stickslip " STICKSLIP_VERSION);
  app.require_subcommand(1);
  app.footer(
      "Exit status: 0 done, whatever the verdict; 2 bad arguments or input; 1 anything else.");

  Action action;
  add_simulate(app, action);
  add_diagnose(app, action);
  add_estimate(app, action);
  add_evaluate(app, action);
  add_calibration(app, action);
  add_check(app, action);
  add_config(app, action);
  add_record(app, action);
  add_replay(app, action);
  add_convert(app, action);
  add_ctl(app, action);
  add_spy(app, action);
  add_scope(app, action);
  add_log(app, action);
  add_poincare(app, action);
  add_lyapunov(app, action);
  add_bifurcation(app, action);
  add_reduce(app, action);
  add_conceal(app, action);
  add_examine(app, action);
  add_figures(app, action);
  add_devices(app, action);
  add_doctor(app, action);
  add_completion(app, action);
  add_manual(app, action);

  std::string known;
  bool is_known = false;
  for (const CLI::App* each : app.get_subcommands([](CLI::App*) { return true; })) {
    is_known = is_known || (argc > 1 && each->get_name() == argv[1]);
    known += (known.empty() ? "" : ", ") + each->get_name();
  }
  if (argc < 2 || (argv[1][0] != '-' && !is_known)) {
    std::fprintf(stderr, "stickslip: %s; expected one of %s\n",
                 argc < 2 ? "no command is given"
                          : ("there is no command \"" + std::string(argv[1]) + "\"").c_str(),
                 known.c_str());
    return 2;
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    std::fprintf(stderr, "stickslip: %s (--help tells what can be given)\n", error.what());
    return 2;
  }
  const Action chosen = action;  // `manual` parses once more
  const int status = chosen();
  // Standard output is buffered: that it could not be written shows here.
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    throw std::runtime_error(std::string("standard output cannot be written: ") +
                             std::strerror(errno));
  }
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
