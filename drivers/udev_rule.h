// What lets this program open a USB device.
#pragma once

namespace stickslip::drivers {

/// For a person whom the kernel refused one. systemd/70-stickslip.rules has a line for every device
/// that a driver of ours opens.
inline constexpr const char* udev_rule_cure =
    "70-stickslip.rules gives it to the group stickslip: sudo usermod -aG stickslip $USER, and log "
    "in again. Where that rule is not installed: sudo cp systemd/70-stickslip.rules "
    "/etc/udev/rules.d/ && sudo udevadm control --reload && sudo udevadm trigger";

}  // namespace stickslip::drivers
