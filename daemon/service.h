// The daemon as a whole: a rig configuration, run from start to stop.
#pragma once

#include <csignal>
#include <filesystem>
#include <optional>
#include <string>

#include "config/rig.h"
#include "daemon/loop.h"

namespace stickslip::daemon {

/// What a command line says beyond the configuration.
struct Overrides {
  std::optional<double> duration_s;
  std::optional<std::filesystem::path> record;
  std::optional<std::string> lcm_url;
  bool no_lcm = false;
  std::optional<std::filesystem::path> control;
};

/// The configuration with the overrides in it. Throws InputError where one makes no sense.
config::Rig with_overrides(config::Rig rig, const Overrides& overrides);

/// Who paces the loop on this rig.
Pacing pacing_of(const config::Rig& rig, const drivers::Description& device);

/// What `serve` waits for: SIGTERM and SIGINT stop, SIGHUP reloads.
sigset_t heeded_signals();

/// Runs the rig until it is told to stop by SIGTERM or SIGINT, its time is over, its data ends, or
/// a device fails. Progress goes to the default spdlog logger. Returns the exit status: 0 where the
/// run ended as it should and the ledger balances, else 1. Throws InputError for a configuration
/// that cannot be run (recording folder, LCM URL, recording to replay).
///
/// The heeded signals must be blocked in every thread of the process before the call.
int serve(const config::Rig& rig);

}  // namespace stickslip::daemon
