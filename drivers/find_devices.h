// Every device on this host that a driver of ours could use.
#pragma once

#include <vector>

#include "drivers/attached.h"

namespace stickslip::drivers {

/// In the order boards, bridges, GPIO chips. What is found is asked who it is, and nothing else.
/// Units on a Modbus bus do not announce themselves: a rig's configuration says where they are.
std::vector<Attached> find_devices();

}  // namespace stickslip::drivers
