// SPDX-License-Identifier: Apache-2.0
// Enumeration of the supported devices on this host.
#pragma once

#include <vector>

#include "drivers/attached_device.h"

namespace stickslip::drivers {

/// In the order boards, bridges, GPIO chips. Devices are identified, and nothing else is sent.
/// Units on a Modbus bus and boards on Ethernet cannot be enumerated: the configuration of a rig
/// gives their addresses.
std::vector<AttachedDevice> find_devices();

}  // namespace stickslip::drivers
