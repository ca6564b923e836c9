// SPDX-License-Identifier: Apache-2.0
// Recordings in several logs, each of which is a log of its own.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "protocol/recording_survey.h"

namespace stickslip::protocol {

/// File of a part of the recording that begins in `file`: run.log, run.001.log, ...
std::filesystem::path part_file(const std::filesystem::path& file, std::int32_t part);

/// True if both descriptions are of the same recording.
bool of_one_recording(const recording_info_t& a, const recording_info_t& b);

/// Inconsistencies between parts of one recording in the order of their numbers: missing or
/// repeated parts, frames missing in the parts before, sequence or time that does not continue. One
/// sentence each. All parts have an info.
std::vector<std::string> faults_between(std::span<const LogSurvey> parts);

struct JoinResult {
  std::uint64_t parts = 0;
  std::uint64_t frames = 0;
  std::uint64_t missing = 0;       ///< frames missing between parts
  std::int64_t cut_off_bytes = 0;  ///< of the last part
};

/// Joins the parts, in any order, into one log: the description of the first, then the events of
/// all. Throws InputError, without an output file, if one is damaged (the last may be truncated),
/// of another recording, or missing.
JoinResult join_logs(std::span<const std::filesystem::path> files, const std::filesystem::path& out,
                     const ProgressCallback& done = {});

}  // namespace stickslip::protocol
