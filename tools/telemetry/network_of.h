// LCM where another process hears it: in a network namespace of its own.
#pragma once

namespace stickslip::telemetry {

/// Puts this process into the network namespace of process `pid`, as tools/own-network makes one.
/// Sockets that are open stay where they are: one that listens outside goes on to do so. To be
/// called before any thread is started. Throws InputError where there is no such process, and
/// std::runtime_error where the system does not permit it.
void enter_network_of(int pid);

}  // namespace stickslip::telemetry
