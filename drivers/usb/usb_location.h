// SPDX-License-Identifier: Apache-2.0
// Location of a USB device, as lsusb and the kernel write it.
#pragma once

#include <libusb-1.0/libusb.h>

#include <string>

namespace stickslip::drivers {

/// "USB 1-2.3": bus 1, port 2 of its root hub, port 3 of the hub there.
std::string usb_location(libusb_device* device);

}  // namespace stickslip::drivers
