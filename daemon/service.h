// SPDX-License-Identifier: Apache-2.0
// The daemon as a whole: a rig configuration, run from start to stop.
#pragma once

#include <csignal>
#include <filesystem>
#include <optional>
#include <string>

#include "config/rig.h"
#include "daemon/pacing.h"
#include "drivers/driver.h"

namespace stickslip::daemon {

/// Command-line options that override the configuration.
struct Overrides {
  std::optional<double> duration_s;
  std::optional<std::filesystem::path> record;
  std::optional<std::string> lcm_url;
  bool no_lcm = false;
  std::optional<std::filesystem::path> control;
};

/// The configuration with the overrides applied. Throws InputError for an invalid one.
config::Rig with_overrides(config::Rig rig, const Overrides& overrides);

Pacing pacing_of(const config::Rig& rig, const drivers::Description& device);

/// SIGTERM and SIGINT, which stop `serve`, and SIGHUP, which makes it reload.
sigset_t handled_signals();

/// Runs the rig until SIGTERM or SIGINT, the end of its duration or data, or a fault that ends it.
/// Logs to the default spdlog logger. Returns the exit status: 0 if the run ended as intended and
/// the ledger balances, else 1. Throws InputError for a configuration that cannot be run (recording
/// folder, LCM URL, recording to replay).
///
/// The handled signals must be blocked in every thread of the process before the call.
int serve(const config::Rig& rig);

}  // namespace stickslip::daemon
