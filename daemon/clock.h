// The time that the loop lives by. Absolute, monotonic, and replaceable in tests: the host's, as
// the drivers know it.
#pragma once

#include "drivers/host_clock.h"

namespace stickslip::daemon {

using Clock = drivers::HostClock;

/// CLOCK_MONOTONIC: never set, never stepped, stands still while the machine is suspended. Signals
/// do not end its waits.
using MonotonicClock = drivers::MonotonicHostClock;

}  // namespace stickslip::daemon
