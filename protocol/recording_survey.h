// What a log holds and what is wrong with it, all of it: for logs that a reader of recordings would
// refuse, and for trust in those that it takes.
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
#include "protocol/recording_events.h"

namespace stickslip::protocol {

/// Bytes of a log that are of no use.
struct Spoilt {
  std::int64_t at = 0;
  std::int64_t bytes = 0;
  std::string why;
};

struct ChannelEvents {
  std::string name;
  std::uint64_t events = 0;
  std::uint64_t bytes = 0;  ///< of data
};

/// The values of one channel of the frames; least and greatest are 0 while there is none.
struct ChannelRange {
  std::uint64_t values = 0;
  double least = 0.0;
  double greatest = 0.0;
};

/// The books of the recorder as its last status in the log has them.
struct RecordedLedger {
  std::int64_t produced = 0;  ///< frames since the start of the recording, all parts
  std::int64_t recorded = 0;
  std::vector<std::string> loss_names;
  std::vector<std::int64_t> losses;
  std::uint64_t frames_before_it = 0;  ///< frames in this log before that status

  std::int64_t lost() const;
  /// Nothing was on its way: the last status of a recording that was ended.
  bool closed() const { return produced == recorded + lost(); }
};

struct LogSurvey {
  std::string source;
  std::int64_t bytes = 0;
  std::vector<ChannelEvents> channels;  ///< in the order of their first event; of sound ones only
  std::uint64_t events = 0;             ///< sound ones

  std::vector<Spoilt> spoilt;  ///< the first hundred
  std::uint64_t spoilt_places = 0;
  std::int64_t spoilt_bytes = 0;
  std::uint64_t bad_checksums = 0;  ///< blocks of frames that do not add up
  std::uint64_t undecodable = 0;    ///< events on our channels that are no message of their type
  std::uint64_t misnumbered = 0;    ///< events whose number is not the next: some were taken out
  std::int64_t cut_off_bytes = 0;

  std::uint64_t frames = 0;
  std::uint64_t gaps = 0;        ///< jumps of the sequence number
  std::uint64_t missing = 0;     ///< frames that they jump over
  std::uint64_t repeats = 0;     ///< sequence numbers that did not increase
  std::uint64_t times_back = 0;  ///< frames whose time is not behind that of the one before
  std::int64_t first_time_ns = 0;
  std::int64_t last_time_ns = 0;
  std::uint64_t first_sequence = 0;
  std::uint64_t last_sequence = 0;
  std::array<ChannelRange, channel_count> ranges{};

  std::optional<recording_info_t> info;   ///< the first event's, where it is one
  std::vector<std::string> spoilt_texts;  ///< of the description: those whose digest is another
  std::optional<RecordedLedger> ledger;   ///< of logs that the recorder of a daemon wrote itself

  /// The number of the part that this is; 0 where it does not say.
  std::int32_t part() const { return info ? info->part : 0; }
  /// Frames per second; 0 for less than two frames.
  double rate_hz() const;
  double duration_s() const;
  /// What is wrong, one sentence each; empty: the log is sound. A gap that the recorder counted as
  /// a loss is no fault of the log.
  std::vector<std::string> faults() const;
};

/// Reads all of it. Throws InputError where the file cannot be read or is no LCM event log.
LogSurvey survey_log(const std::filesystem::path& file, const ShareDone& done = {});
/// The same for a stream that can seek; `name` stands for the file. Any bytes do.
LogSurvey survey_log(std::istream& in, const std::string& name, const ShareDone& done = {});

/// What was kept of a log, and what was not.
struct Repair {
  std::uint64_t events = 0;  ///< kept
  std::uint64_t frames = 0;
  std::uint64_t spoilt_places = 0;
  std::int64_t spoilt_bytes = 0;
  std::uint64_t bad_checksums = 0;
  std::uint64_t undecodable = 0;
  std::uint64_t blocks_back_in_time = 0;  ///< whole, but no recording could go on with them
  std::int64_t cut_off_bytes = 0;

  bool dropped_anything() const;
};

/// Hands every whole and sound event to `keep`, in order; with those of ours that a recording can
/// go on with, `read_recording` reads the result.
Repair repair_log(std::istream& in, const std::string& name,
                  const std::function<void(const LogEvent&)>& keep, const ShareDone& done = {});

/// The same into another file. Throws InputError where either cannot be used, both are one, or
/// nothing is whole.
Repair repair_log(const std::filesystem::path& file, const std::filesystem::path& out,
                  const ShareDone& done = {});

}  // namespace stickslip::protocol
