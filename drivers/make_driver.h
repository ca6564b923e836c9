// From a configuration to the device that it names.
#pragma once

#include <memory>
#include <vector>

#include "config/rig.h"
#include "drivers/driver.h"

namespace stickslip::drivers {

/// The driver of that rig, not yet open; where the rig has a fault script, behind its faults.
/// `frames_to_replay` are the frames of rig.replay.recording, read by the caller (drivers know no
/// file format); ignored by other drivers.
std::unique_ptr<Driver> make_driver(const config::Rig& rig,
                                    std::vector<Frame> frames_to_replay = {});

}  // namespace stickslip::drivers
