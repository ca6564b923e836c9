// libusb-1.0 without a kernel: the functions that drivers call, defined in a static library. A test
// program that links `stickslip_emulated_libusb` uses them instead of the shared library's, and
// finds on its bus what the test plugged into an EmulatedBus.
//
// As the real library: callbacks run only inside the event handling of their context; a cancelled
// transfer ends later, as CANCELLED; a device that is unplugged ends everything with NO_DEVICE; a
// time-out counts real time. There is no hotplug support, and the library says so.
#pragma once

#include "tests/emulated/attach/emulated_bus.h"
