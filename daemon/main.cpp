// SPDX-License-Identifier: Apache-2.0
// `stickslipd`: the command line of the daemon.
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <exception>
#include <memory>
#include <optional>
#include <string>

#include "config/rig.h"
#include "config/shipped_files.h"
#include "daemon/service.h"
#include "physics/failure.h"

namespace {

using stickslip::daemon::Overrides;

int run(int argc, char** argv) {
  CLI::App app{"Runs a dry-friction oscillator rig: acquires, drives, publishes on LCM, records.",
               "stickslipd"};
  app.set_version_flag("--version", "stickslipd " STICKSLIP_VERSION);
  app.footer(
      "On SIGTERM or SIGINT it ramps the drive down, switches the amplifier off, drains its queues "
      "and\n"
      "exits. On SIGHUP it reloads its configuration. Commands are given with stickslip ctl.\n"
      "Exit status: 0 done; 2 bad arguments or configuration, or a log or socket that another\n"
      "daemon uses; 1 anything else: a device fault, a recording that is not whole, or a ledger\n"
      "that does not balance.");

  std::string config_file;
  Overrides overrides;
  double duration_s = 0.0;
  std::string record;
  std::string url;
  std::string socket;
  bool quiet = false;
  app.add_option("--config", config_file, "Rig configuration (TOML)")
      ->type_name("FILE")
      ->required();
  auto* duration =
      app.add_option("--duration", duration_s, "Stop after this many seconds of rig time")
          ->type_name("SECONDS");
  auto* recording =
      app.add_option("--record", record, "Record to this LCM event log")->type_name("FILE");
  auto* lcm_url = app.add_option("--lcm-url", url, "Publish to this LCM URL")->type_name("URL");
  app.add_flag("--no-lcm", overrides.no_lcm, "Do not publish")->excludes(lcm_url);
  auto* control =
      app.add_option("--control", socket, "Path of the control socket")->type_name("PATH");
  app.add_flag("--quiet", quiet, "Log warnings and errors only");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (duration->count() > 0) overrides.duration_s = duration_s;
  if (recording->count() > 0) overrides.record = record;
  if (lcm_url->count() > 0) overrides.lcm_url = url;
  if (control->count() > 0) overrides.control = socket;

  auto logger = std::make_shared<spdlog::logger>("stickslipd",
                                                 std::make_shared<spdlog::sinks::stderr_sink_mt>());
  logger->set_pattern("%H:%M:%S.%e %L %v");
  logger->set_level(quiet ? spdlog::level::warn : spdlog::level::info);
  logger->flush_on(spdlog::level::info);
  spdlog::set_default_logger(logger);

  // Before the first thread, so that all inherit the mask: the housekeeping reads these signals.
  const sigset_t signals = stickslip::daemon::handled_signals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);

  std::signal(SIGXFSZ, SIG_IGN);  // a limit on the size of files is an error of the write
  const auto rig = stickslip::daemon::with_overrides(
      stickslip::config::load_rig(stickslip::config::file_meant(config_file, "")), overrides);
  for (const stickslip::Problem& warning : rig.warnings) spdlog::warn("{}", warning.text());
  return stickslip::daemon::serve(rig);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    const stickslip::Ending ending = stickslip::ending_of(error, "stickslipd");
    std::fprintf(stderr, "stickslipd: %s\n", ending.line.c_str());
    return ending.status;
  }
}
