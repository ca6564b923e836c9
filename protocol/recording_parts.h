// Recordings in several logs: each part stands alone, and together they are one recording.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "protocol/recording_survey.h"

namespace stickslip::protocol {

/// The file of that part of the recording that begins in `file`: run.log, run.001.log, ...
std::filesystem::path part_file(const std::filesystem::path& file, std::int32_t part);

/// Whether both say that they are of one recording.
bool belong_together(const recording_info_t& a, const recording_info_t& b);

/// What is wrong between parts of one recording, in the order of their numbers: a part that is
/// missing or there twice, frames that the parts before should hold, sequence or time that does not
/// go on. One sentence each. All have an info.
std::vector<std::string> faults_between(std::span<const LogSurvey> parts);

struct Joined {
  std::uint64_t parts = 0;
  std::uint64_t frames = 0;
  std::uint64_t missing = 0;       ///< frames jumped over where one part follows another
  std::int64_t cut_off_bytes = 0;  ///< of the last part
};

/// Puts the parts, in any order, together into one log: the first one's description, then the
/// events of all. Throws InputError, with nothing left behind, where one is damaged (the last may
/// be cut off), they do not belong together, or one is missing between others.
Joined join_logs(std::span<const std::filesystem::path> files, const std::filesystem::path& out,
                 const ShareDone& done = {});

}  // namespace stickslip::protocol
