// LCM event logs as recordings; the room's own side of protocol/recording.h.
#pragma once

#include <filesystem>
#include <string_view>

#include "protocol/recording.h"

namespace stickslip::protocol {

/// Whether a file that begins so is an LCM event log.
bool is_log(std::string_view head);

/// As read_recording, for a file that is one.
Recording read_log(const std::filesystem::path& file);

}  // namespace stickslip::protocol
