// SPDX-License-Identifier: Apache-2.0
// Recordings named on the command line.
#pragma once

#include <cstdio>
#include <filesystem>

#include "protocol/recording.h"
#include "tools/terminal/progress.h"

namespace stickslip::command_line {

/// Warns on standard error of a file that ends too early.
inline void warn_if_cut_off(const protocol::Recording& recording) {
  if (recording.cut_off_bytes == 0) return;
  std::fprintf(stderr, "stickslip: %s\n", protocol::cut_off_warning(recording).c_str());
}

/// States on standard error when the rig had another model: the frames are readings and the same
/// with any, but the estimates and verdicts in the log are those of the model of their time.
inline void report_model_changes(const protocol::Recording& recording) {
  for (const protocol::ModelChange& change : recording.model_changes) {
    std::fprintf(stderr, "stickslip: %s\n", protocol::model_change_note(recording, change).c_str());
  }
}

/// As protocol::read_recording, with progress on a terminal. Warns on standard error of a truncated
/// log, whose intact part is returned, and reports changes of the rig's model.
inline protocol::Recording recording_from(const std::filesystem::path& file,
                                          std::size_t most_frames = protocol::all_frames) {
  terminal::Progress progress("reading " + file.filename().string());
  protocol::Recording recording = protocol::read_recording(
      file, [&progress](double share) { progress.at(share); }, most_frames);
  progress.finish();
  warn_if_cut_off(recording);
  report_model_changes(recording);
  return recording;
}

}  // namespace stickslip::command_line
