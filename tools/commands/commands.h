// How a subcommand of `stickslip` presents itself: it adds its options to the parser and leaves
// behind what to do if it is the one that was called.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "tools/command_line/action.h"

namespace stickslip::commands {

using command_line::Action;

void add_simulate(CLI::App& app, Action& action);
void add_diagnose(CLI::App& app, Action& action);
void add_estimate(CLI::App& app, Action& action);
void add_evaluate(CLI::App& app, Action& action);
void add_calibration(CLI::App& app, Action& action);
void add_check(CLI::App& app, Action& action);
void add_config(CLI::App& app, Action& action);
void add_record(CLI::App& app, Action& action);
void add_replay(CLI::App& app, Action& action);
void add_convert(CLI::App& app, Action& action);
void add_ctl(CLI::App& app, Action& action);
void add_spy(CLI::App& app, Action& action);
void add_poincare(CLI::App& app, Action& action);
void add_log(CLI::App& app, Action& action);
void add_lyapunov(CLI::App& app, Action& action);
void add_bifurcation(CLI::App& app, Action& action);
void add_reduce(CLI::App& app, Action& action);
void add_conceal(CLI::App& app, Action& action);
void add_examine(CLI::App& app, Action& action);
void add_figures(CLI::App& app, Action& action);
void add_devices(CLI::App& app, Action& action);
void add_scope(CLI::App& app, Action& action);
void add_doctor(CLI::App& app, Action& action);
void add_completion(CLI::App& app, Action& action);
void add_manual(CLI::App& app, Action& action);

/// `ctl calibrate`. `socket`: the option of `ctl`, set once the command line has been parsed.
void add_ctl_calibrate(CLI::App& ctl, std::shared_ptr<const std::string> socket, Action& action);

}  // namespace stickslip::commands
