// Destination of encoded messages: LCM for the publisher, a log for the recorder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "daemon/ledger.h"

namespace stickslip::daemon {

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

/// A new LCM event log, in parts if the settings say so: run.log, run.001.log, ... An existing log
/// of that name is kept under another one. What makes a recording self-contained is taken from the
/// description, which has to be written first. Throws InputError if the log cannot be written or
/// the name asks for another format.
std::unique_ptr<MessageWriter> open_log(const std::filesystem::path& file,
                                        const RecorderSettings& settings = {});

}  // namespace stickslip::daemon
