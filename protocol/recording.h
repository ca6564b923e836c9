// Recordings: a CSV file by the contract, or an LCM event log as the daemon writes it. The same
// frames in either form are the same recording, to the bit.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "physics/frame.h"
#include "protocol/share_done.h"

namespace stickslip::protocol {

/// What a log says about itself; all empty for a CSV file.
struct Description {
  std::int64_t started_utc_us = 0;
  std::string rig;
  std::string program;
  std::string version;
  std::string configuration;
  std::string model;
  std::string calibration = {};
  std::int32_t part = 0;           ///< of a recording in several logs, from 0
  std::string previous_part = {};  ///< file name of the part before, without folder
  std::int64_t frames_before = 0;  ///< in all parts before this one
  std::string fault_script = {};   ///< what was made to befall the device; empty: nothing

  friend bool operator==(const Description&, const Description&) = default;
};

/// A wall-clock time [us since 1970] as "2024-07-03T09:46:40Z"; empty for 0 and below: not known.
std::string utc_text(std::int64_t utc_us);

struct Recording {
  std::string source;         ///< the file it came from
  std::vector<Frame> frames;  ///< in strictly increasing time
  std::uint8_t channels = 0;  ///< bit i: some frame holds Channel i
  Description description;
  /// Bytes at the end of a log that are no whole event: it was cut off there, by a killed recorder
  /// or a power cut. Everything before them is here.
  std::uint64_t cut_off_bytes = 0;
};

/// For who was asked to read a log that was cut off (cut_off_bytes is not 0): one line, with the
/// file, for a warning.
std::string cut_off_warning(const Recording& recording);

/// The usual time from one frame to the next [s]; at least two frames.
double median_period_s(std::span<const Frame> frames);

/// Reads either form; which one is decided by the content, not by the name. Throws InputError
/// naming the file, and the line (CSV) or the byte (log), for whatever is wrong: no time_s, an
/// unknown or doubled column, a missing or surplus cell, text or nan in a number, time that does
/// not increase, a log that is damaged before its end or holds no frames. An empty cell is a sample
/// that is not there. A log that only ends too early is read up to there: see cut_off_bytes.
/// `done`, here and below, is told how far it is.
Recording read_recording(const std::filesystem::path& file, const ShareDone& done = {});

/// The same for text in memory; `name` stands for the file in messages.
Recording parse_csv(std::string_view text, const std::string& name, const ShareDone& done = {});

/// Writes CSV for ".csv" or "-" (standard output), an LCM event log for ".lcm" and ".log". Throws
/// InputError where the name says neither or the file cannot be written.
void write_recording(const Recording& recording, const std::filesystem::path& file,
                     const ShareDone& done = {});

/// CSV by the contract: time_s exact to the nanosecond, values so that they read back to the bit.
/// Sequence numbers are not part of it: a CSV file counts from 0.
void write_csv(const Recording& recording, std::ostream& out, const ShareDone& done = {});

/// Appends events to an LCM event log, which stock lcm-logplayer plays.
class LogWriter {
 public:
  /// Creates or replaces `file`. Throws InputError where it cannot be.
  explicit LogWriter(const std::filesystem::path& file);
  ~LogWriter();
  LogWriter(LogWriter&&) noexcept;
  LogWriter& operator=(LogWriter&&) noexcept;

  /// False where the disk refused it (errno says why), and from then on until the next flush.
  [[nodiscard]] bool append(const std::string& channel, std::span<const std::uint8_t> bytes,
                            std::int64_t time_us);
  /// Whether all that was appended since the last flush is in the file. If not, none of it is: the
  /// file ends with what the last good flush left, so that it can be read and be continued.
  [[nodiscard]] bool flush();
  /// Waits until the disk has what the last good flush left; false (errno says why) where it says
  /// that it has not. True for what is no file on a disk.
  [[nodiscard]] bool sync();
  /// Flushes and closes; false where that failed. Further appends fail.
  [[nodiscard]] bool close();
  /// Of the file, with what is not flushed yet.
  std::uint64_t bytes_written() const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// Writes the recording as a log: its description, then blocks of `frames_per_block` frames.
void write_log(const Recording& recording, const std::filesystem::path& file,
               std::size_t frames_per_block = 10, const ShareDone& done = {});

}  // namespace stickslip::protocol
