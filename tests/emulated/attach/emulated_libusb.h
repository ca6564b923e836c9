// SPDX-License-Identifier: Apache-2.0
// libusb-1.0 without a kernel: the functions that drivers call, in a static library. A test program
// that links `stickslip_emulated_libusb` uses them instead of the shared library, and finds the
// devices on its EmulatedBus.
//
// Like the real library: callbacks run only during event handling of their context; a cancelled
// transfer ends later, as CANCELLED; after an unplug everything ends with NO_DEVICE; time-outs are
// in real time. Hotplug is reported as unsupported.
#pragma once

#include "tests/emulated/attach/emulated_bus.h"
