// SPDX-License-Identifier: Apache-2.0
// Recordings that the configuration names.
#pragma once

#include <filesystem>

#include "protocol/recording.h"

namespace stickslip::daemon {

/// As protocol::read_recording; logs a warning about a file that ends too early.
protocol::Recording recording_from(const std::filesystem::path& file);

}  // namespace stickslip::daemon
