// SPDX-License-Identifier: Apache-2.0
// Settings of the daemon's parts, derived from a rig's configuration and its device.
#pragma once

#include <filesystem>
#include <optional>

#include "config/rig.h"
#include "config/settings.h"
#include "daemon/command.h"
#include "daemon/loop.h"
#include "daemon/setting.h"
#include "daemon/stream.h"
#include "drivers/driver.h"

namespace stickslip::daemon {

StreamSettings stream_settings(const config::Rig& rig, Pacing pacing);

/// Without recorder and model check.
LoopSettings loop_settings(const config::Rig& rig, const drivers::Description& device,
                           Pacing pacing);

LiveSettings live_settings(const config::Rig& rig, const drivers::Description& device);

/// A change of a configuration key as a setting of the running excitation; nullopt if the key is
/// not tunable. `now`: the configuration after the change.
std::optional<Setting> setting_change(const config::Change& change, const config::Rig& now);

/// Path of the control socket; empty: none.
std::filesystem::path control_socket(const config::Rig& rig);

}  // namespace stickslip::daemon
