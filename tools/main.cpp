// `stickslip`: the tools around the daemon, one file or folder per subcommand.
#include <cstdio>
#include <exception>

#include "physics/problem.h"
#include "tools/command.h"

namespace {

int run(int argc, char** argv) {
  using namespace stickslip::tools;
  CLI::App app{"Tools for a dry-friction oscillator rig: simulate, record, replay, diagnose.",
               "stickslip"};
  app.set_version_flag("--version", "stickslip " STICKSLIP_VERSION);
  app.require_subcommand(1);
  app.footer(
      "Exit status: 0 done, whatever the verdict; 2 bad arguments or input; 1 anything else.");

  Action action;
  add_simulate(app, action);
  add_diagnose(app, action);
  add_evaluate(app, action);
  add_check(app, action);
  add_record(app, action);
  add_replay(app, action);
  add_convert(app, action);
  add_spy(app, action);
  add_poincare(app, action);
  add_lyapunov(app, action);
  add_bifurcation(app, action);
  add_reduce(app, action);
  add_figures(app, action);

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const int status = app.exit(error);
    return status == 0 ? 0 : 2;
  }
  return action();
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
