// A recording that a command was given.
#pragma once

#include <cstdio>
#include <filesystem>

#include "protocol/recording.h"

namespace stickslip::tools {

/// As protocol::read_recording; of a log that was cut off it says so on standard error, and goes on
/// with what is there.
inline protocol::Recording recording_from(const std::filesystem::path& file) {
  protocol::Recording recording = protocol::read_recording(file);
  if (recording.cut_off_bytes > 0) {
    std::fprintf(stderr, "stickslip: %s\n", protocol::cut_off_warning(recording).c_str());
  }
  return recording;
}

}  // namespace stickslip::tools
