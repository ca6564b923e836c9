// A recording that a command was given.
#pragma once

#include <cstdio>
#include <filesystem>

#include "protocol/recording.h"
#include "tools/terminal/progress.h"

namespace stickslip::command_line {

/// As protocol::read_recording, with its progress on a terminal; of a log that was cut off it says
/// so on standard error, and goes on with what is there.
inline protocol::Recording recording_from(const std::filesystem::path& file) {
  terminal::Progress progress("reading " + file.filename().string());
  protocol::Recording recording =
      protocol::read_recording(file, [&progress](double share) { progress.at(share); });
  progress.finish();
  if (recording.cut_off_bytes > 0) {
    std::fprintf(stderr, "stickslip: %s\n", protocol::cut_off_warning(recording).c_str());
  }
  return recording;
}

}  // namespace stickslip::command_line
