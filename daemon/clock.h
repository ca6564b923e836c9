// SPDX-License-Identifier: Apache-2.0
// The loop's clock: absolute, monotonic, and replaceable in tests.
#pragma once

#include "drivers/clock/host_clock.h"

namespace stickslip::daemon {

using Clock = drivers::HostClock;

/// CLOCK_MONOTONIC: never set or stepped, stopped while the machine is suspended. Its waits survive
/// signals.
using MonotonicClock = drivers::MonotonicHostClock;

}  // namespace stickslip::daemon
