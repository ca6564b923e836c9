// hidapi (its hidraw backend) without a kernel: the functions that drivers call, defined in a
// static library. A test program that links `stickslip_emulated_hidapi` uses them instead of the
// shared library's, and finds on its bus the devices with a HID interface that the test plugged
// into an EmulatedBus.
//
// As the real one: input reports are taken from the device all the time, and the newest 64 wait for
// whoever reads; output reports go to the interrupt OUT endpoint where there is one, else by
// SET_REPORT; a first byte of 0 means that the device numbers no reports, and does not travel; a
// device that is unplugged answers -1 from then on, after the reports that had come before. A
// refused device is listed and cannot be opened.
#pragma once

#include "tests/emulated/attach/emulated_bus.h"
