// SPDX-License-Identifier: Apache-2.0
// hidapi (hidraw backend) without a kernel: the functions that drivers call, in a static library. A
// test program that links `stickslip_emulated_hidapi` uses them instead of the shared library, and
// finds the devices with a HID interface on its EmulatedBus.
//
// Like the real library: input reports are read continuously, and the newest 64 are buffered;
// output reports go to the interrupt OUT endpoint if present, else by SET_REPORT; a first byte of 0
// (no report ID) is not transmitted; after an unplug, buffered reports are followed by -1. A device
// without permission is listed and cannot be opened.
#pragma once

#include "tests/emulated/attach/emulated_bus.h"
