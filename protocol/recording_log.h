// SPDX-License-Identifier: Apache-2.0
// Recordings in LCM event logs; internal to protocol/.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <span>
#include <stickslip/recording_info_t.hpp>
#include <string>
#include <string_view>

#include "protocol/recording.h"

namespace stickslip::protocol {

/// Current format of logs.
inline constexpr std::int32_t log_schema = 3;

/// As read_recording, for a log.
Recording read_log(const std::filesystem::path& file, const ProgressCallback& done = {},
                   std::size_t most_frames = all_frames);

/// The same for a seekable stream; messages name the file as `name`.
Recording parse_log(std::istream& in, const std::string& name, const ProgressCallback& done = {},
                    std::size_t most_frames = all_frames);

/// The first message of a log, with the digests of its texts. `frames`: number of frames of the
/// source, -1: being recorded.
recording_info_t info_of(const Description& description, std::int64_t frames);

/// Number of frames in the header of an encoded block; 0 if it is too short.
std::int64_t frames_in(std::span<const std::uint8_t> block);

/// The description in a message.
Description description_of(const recording_info_t& info);

}  // namespace stickslip::protocol
