// SPDX-License-Identifier: Apache-2.0
// Permission to open USB devices.
#pragma once

namespace stickslip::drivers {

/// Remedy for denied access. systemd/70-stickslip.rules has a line for every supported device.
inline constexpr const char* udev_rule_remedy =
    "70-stickslip.rules gives it to the group stickslip: sudo usermod -aG stickslip $USER, and log "
    "in again. If that rule is not installed: sudo cp systemd/70-stickslip.rules "
    "/etc/udev/rules.d/ && sudo udevadm control --reload && sudo udevadm trigger";

}  // namespace stickslip::drivers
