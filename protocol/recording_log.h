// LCM event logs as recordings; the room's own side of protocol/recording.h.
#pragma once

#include <filesystem>
#include <iosfwd>
#include <string>
#include <string_view>

#include "protocol/recording.h"

namespace stickslip::protocol {

/// Whether a file that begins so is an LCM event log.
bool is_log(std::string_view head);

/// As read_recording, for a file that is one.
Recording read_log(const std::filesystem::path& file);

/// The same for a stream that can seek; `name` stands for the file in messages.
Recording parse_log(std::istream& in, const std::string& name);

}  // namespace stickslip::protocol
