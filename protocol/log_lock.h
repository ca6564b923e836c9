// SPDX-License-Identifier: Apache-2.0
// Exclusive use of a log by the process that writes it. The kernel releases a lock when its process
// ends, however it ends.
#pragma once

#include <filesystem>

namespace stickslip::protocol {

/// Locks an open file until its descriptor is closed. The lock stays with the file when that is
/// renamed. Pipes, devices and file systems without locks are not locked. Throws InputError if it
/// is locked already, naming the process where the system does.
void lock_log(int descriptor, const std::filesystem::path& file);

/// Throws InputError, as above, if a process is writing the log. A file that does not exist or
/// cannot be opened is free.
void require_free_log(const std::filesystem::path& file);

}  // namespace stickslip::protocol
