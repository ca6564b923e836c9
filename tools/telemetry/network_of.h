// SPDX-License-Identifier: Apache-2.0
// Access to LCM in the network namespace of another process.
#pragma once

namespace stickslip::telemetry {

/// Moves this process into the network namespace of process `pid`, for example one made by
/// tools/own-network. Open sockets keep their namespace. Must be called before any thread is
/// started. Throws InputError if there is no such process, Failure if the system
/// call fails.
void enter_network_of(int pid);

}  // namespace stickslip::telemetry
