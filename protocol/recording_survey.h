// SPDX-License-Identifier: Apache-2.0
// Complete survey of a log: its content and all of its faults, also for logs that cannot be read as
// recordings.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <iosfwd>
#include <optional>
#include <span>
#include <stickslip/recording_info_t.hpp>
#include <string>
#include <vector>

#include "physics/frame.h"
#include "protocol/recording.h"
#include "protocol/recording_events.h"
#include "protocol/time_steps.h"

namespace stickslip::protocol {

/// Damaged bytes of a log.
struct DamagedRange {
  std::int64_t at = 0;
  std::int64_t bytes = 0;
  std::string why;
};

struct ChannelEvents {
  std::string name;
  std::uint64_t events = 0;
  std::uint64_t bytes = 0;  ///< of data
};

/// Range of one channel; 0 if it has no values.
struct ChannelRange {
  std::uint64_t values = 0;
  double least = 0.0;
  double greatest = 0.0;
};

/// Sample ledger of the recorder in its last status in the log.
struct RecordedLedger {
  std::int64_t produced = 0;  ///< frames since the start of the recording, all parts
  std::int64_t recorded = 0;
  std::vector<std::string> loss_names;
  std::vector<std::int64_t> losses;
  std::uint64_t frames_before_it = 0;  ///< frames in this log before that status

  std::int64_t lost() const;
  /// True if no frames were pending: the last status of a recording that was ended.
  bool closed() const { return produced == recorded + lost(); }
};

struct LogSurvey {
  std::string source;
  std::int64_t bytes = 0;
  std::vector<ChannelEvents> channels;  ///< intact events only, in the order of the first
  std::uint64_t events = 0;             ///< number of intact events

  std::vector<DamagedRange> damaged;  ///< the first hundred
  std::uint64_t damaged_places = 0;
  std::int64_t damaged_bytes = 0;
  std::uint64_t bad_checksums = 0;  ///< blocks of frames
  std::uint64_t undecodable = 0;    ///< events on known channels that do not decode as their type
  std::uint64_t misnumbered = 0;    ///< gaps in the numbers of events: some were removed
  std::int64_t cut_off_bytes = 0;

  std::uint64_t frames = 0;
  std::uint64_t gaps = 0;        ///< jumps of the sequence number
  std::uint64_t missing = 0;     ///< frames in these jumps
  std::uint64_t repeats = 0;     ///< sequence numbers that did not increase
  std::uint64_t times_back = 0;  ///< frames whose time did not increase
  std::vector<TimeStep> time_steps;
  std::int64_t first_time_ns = 0;
  std::int64_t last_time_ns = 0;
  std::uint64_t first_sequence = 0;
  std::uint64_t last_sequence = 0;
  std::array<ChannelRange, channel_count> ranges{};

  std::optional<recording_info_t> info;    ///< first event, if it is a description
  std::vector<std::string> altered_texts;  ///< of the description: those with another digest
  std::vector<ModelChange> model_changes;
  std::optional<RecordedLedger> ledger;  ///< of logs written by a daemon

  /// Number of the part; 0 if unknown.
  std::int32_t part() const { return info ? info->part : 0; }
  /// Frames per second without the steps of the time; 0 for less than two frames.
  double rate_hz() const;
  double duration_s() const;
  /// Faults, one sentence each; empty: the log is intact. A gap that the recorder counted as a loss
  /// is not a fault of the log.
  std::vector<std::string> faults() const;
  /// Gaps in the frames and in their time, one sentence each. A log with gaps may be intact, such
  /// as one of a program that received the frames over LCM and lost some.
  std::vector<std::string> gap_sentences() const;

 private:
  /// Frames of the recorder's ledger, or of the recording that was replayed, that are not in the
  /// log.
  std::uint64_t unwritten() const;
  /// True if missing sequence numbers explain all frames that are unwritten, and nothing is
  /// damaged.
  bool is_explained_by_gaps() const;
};

/// Reads a whole log. Throws InputError if the file cannot be read or is not an LCM event log.
LogSurvey survey_log(const std::filesystem::path& file, const ProgressCallback& done = {});
/// The same for a seekable stream of any bytes; messages name it as `name`.
LogSurvey survey_log(std::istream& in, const std::string& name, const ProgressCallback& done = {});

/// Kept and dropped parts of a repaired log.
struct RepairResult {
  std::uint64_t events = 0;  ///< kept
  std::uint64_t frames = 0;
  std::uint64_t damaged_places = 0;
  std::int64_t damaged_bytes = 0;
  std::uint64_t bad_checksums = 0;
  std::uint64_t undecodable = 0;
  std::uint64_t blocks_back_in_time = 0;  ///< intact, but earlier than the block before
  std::int64_t cut_off_bytes = 0;

  bool dropped_anything() const;
};

/// Passes every intact event to `keep`, in order, except blocks that go back in time, so that
/// `read_recording` reads the result.
RepairResult repair_log(std::istream& in, const std::string& name,
                        const std::function<void(const LogEvent&)>& keep,
                        const ProgressCallback& done = {});

/// The same into another file. Throws InputError if either cannot be used, both are the same, or no
/// event is intact.
RepairResult repair_log(const std::filesystem::path& file, const std::filesystem::path& out,
                        const ProgressCallback& done = {});

}  // namespace stickslip::protocol
