// SPDX-License-Identifier: Apache-2.0
// Destination of encoded messages: LCM for the publisher, a log for the recorder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/event.h"
#include "daemon/ledger.h"

namespace stickslip::daemon {

/// A recording as far as it is in its files.
struct RecordingProgress {
  std::filesystem::path file;    ///< the latest part
  std::int32_t part = 0;         ///< from 0
  std::uint64_t file_bytes = 0;  ///< in that part
  std::uint64_t bytes = 0;       ///< in all parts
  std::int64_t length_us = 0;    ///< from the first frame to the latest
};

class MessageWriter {
 public:
  MessageWriter() = default;
  MessageWriter(const MessageWriter&) = delete;
  MessageWriter& operator=(const MessageWriter&) = delete;
  virtual ~MessageWriter() = default;

  /// False if it was refused. `time_us` since the epoch.
  virtual bool write(const std::string& channel, std::span<const std::uint8_t> bytes,
                     std::int64_t time_us) = 0;

  /// True if everything written since the last flush has really left.
  virtual bool flush() { return true; }

  /// True if a flush should not wait until the period is over.
  virtual bool wants_flush() const { return false; }

  /// Any thread: what happened to the destination since the last call, oldest first. After an event
  /// of severity error something of what was written is lost.
  virtual std::vector<Event> take_events() { return {}; }

  /// Any thread. Absent: not a recording.
  virtual std::optional<RecordingProgress> progress() const { return std::nullopt; }

  /// True if everything written is safe. Called once, at the end.
  virtual bool close() { return true; }
};

/// LCM at `url`. Throws InputError if the URL is refused.
std::unique_ptr<MessageWriter> open_lcm(const std::string& url);

struct RecorderSettings {
  std::optional<double> rotate_s = {};   ///< length of a part in the time of its frames; above 0
  std::optional<double> rotate_mb = {};  ///< size of a part, 10^6 bytes; above 0
  double sync_s = 1.0;                   ///< interval of syncs to the disk; 0: none
  Ledger* ledger = nullptr;              ///< written at the end of each part, and credited with
                                         ///< confirmed by the disk; may be null
};

/// A new LCM event log, in parts if configured: run.log, run.001.log, ... An existing log of that
/// name is kept under another one. What makes a recording self-contained is taken from the
/// description, which has to be written first.
///
/// Space for the last messages is allocated ahead: a full disk refuses frames, while events, and at
/// the end the status with the ledger, are still written. A log that was deleted, moved or covered
/// by another disk is noticed at the next flush and begun anew at its path as the next part, or, as
/// long as that fails, once a second; frames flushed to a deleted log are refused.
///
/// Throws InputError if the log cannot be written, if it or another part of that name is being
/// written by a process, or if the name asks for another format. Nothing is changed then.
std::unique_ptr<MessageWriter> open_log(const std::filesystem::path& file,
                                        const RecorderSettings& settings = {});

}  // namespace stickslip::daemon
