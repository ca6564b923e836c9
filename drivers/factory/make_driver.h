// SPDX-License-Identifier: Apache-2.0
// Construction of a driver from a configuration.
#pragma once

#include <memory>
#include <vector>

#include "config/rig.h"
#include "drivers/driver.h"

namespace stickslip::drivers {

/// The driver of a rig, not open, with the faults of its script if it has one. `frames_to_replay`
/// are the frames of rig.replay.recording, read by the caller (drivers know no file format); other
/// drivers ignore them.
std::unique_ptr<Driver> make_driver(const config::Rig& rig,
                                    std::vector<Frame> frames_to_replay = {});

}  // namespace stickslip::drivers
