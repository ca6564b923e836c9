// LCM event logs as recordings; the room's own side of protocol/recording.h.
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

/// The four bytes with which every event of a log begins.
inline constexpr std::string_view sync_word = "\xED\xA1\xDA\x01";

/// Format of the logs that are written now.
inline constexpr std::int32_t log_schema = 3;

/// Whether a file that begins so is an LCM event log.
bool is_log(std::string_view head);

/// As read_recording, for a file that is one.
Recording read_log(const std::filesystem::path& file, const ShareDone& done = {});

/// The same for a stream that can seek; `name` stands for the file in messages.
Recording parse_log(std::istream& in, const std::string& name, const ShareDone& done = {});

/// The message with which a log begins, the digests of its texts included. `frames`: how many the
/// source had, -1: being recorded.
recording_info_t info_of(const Description& description, std::int64_t frames);

/// How many frames an encoded block says that it holds; 0 for what is too short for one.
std::int64_t frames_in(std::span<const std::uint8_t> block);

/// What the message says.
Description description_of(const recording_info_t& info);

}  // namespace stickslip::protocol
