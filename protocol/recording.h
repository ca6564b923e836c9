// SPDX-License-Identifier: Apache-2.0
// Recordings: CSV files, or LCM event logs as written by the daemon. Both hold the same frames, to
// the bit.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "physics/frame.h"
#include "protocol/progress_callback.h"

namespace stickslip::protocol {

/// Description of a log; all empty for a CSV file.
struct Description {
  std::int64_t started_utc_us = 0;
  std::string rig;
  std::string program;
  std::string version;
  std::string configuration;
  std::string model;
  std::string calibration = {};
  std::int32_t part = 0;           ///< of a recording in several logs, from 0
  std::string previous_part = {};  ///< file name of the previous part, without folder
  std::int64_t frames_before = 0;  ///< in all parts before this one
  std::string fault_script = {};   ///< faults injected into the device; empty: none

  friend bool operator==(const Description&, const Description&) = default;
};

/// A wall-clock time [us since 1970] as "2024-07-03T09:46:40Z"; empty for 0 and below, unknown
/// times.
std::string utc_text(std::int64_t utc_us);

/// A change of the rig's model while it was being recorded (event "model_changed").
struct ModelChange {
  std::int64_t time_ns = 0;  ///< of the latest frame before it
  std::string message;       ///< one sentence, with name and SHA-256 of the model file

  friend bool operator==(const ModelChange&, const ModelChange&) = default;
};

struct Recording {
  std::string source;         ///< its file
  std::vector<Frame> frames;  ///< in strictly increasing time
  std::uint8_t channels = 0;  ///< bit i: some frame holds Channel i
  Description description;    ///< the model is the last one
  std::vector<ModelChange> model_changes = {};
  /// Bytes of an incomplete event at the end of a log that was truncated by a killed recorder or a
  /// power cut. All events before are included.
  std::uint64_t cut_off_bytes = 0;
  /// Line of a CSV file without a newline at its end, 0: none. It is not read, since it may have
  /// been cut within a number; cut_off_bytes is its length.
  int cut_off_line = 0;
  /// Frames that were read but not kept: see `most_frames` of read_recording.
  std::uint64_t left_out = 0;
  std::vector<std::size_t> after_left_out = {};  ///< frames before which some were left out
};

/// One line about a change of the model, with the file and the time.
std::string model_change_note(const Recording& recording, const ModelChange& change);

/// No limit to the frames of a recording.
inline constexpr std::size_t all_frames = std::numeric_limits<std::size_t>::max();

/// Warning about a truncated log or CSV file (cut_off_bytes is not 0): one line, with the file.
std::string cut_off_warning(const Recording& recording);

/// Median time between frames [s]; 0 with fewer than two.
double median_period_s(std::span<const Frame> frames);

/// Reads either form, which its content determines, not its name. Throws InputError with the file
/// and the line (CSV) or the byte (log) of a problem: no time_s, an unknown or repeated column, a
/// missing or surplus cell, text or nan in a number, time that does not increase, a log that is
/// damaged before its end or has no frames. An empty cell is a sample that was not measured. A log
/// or a CSV file that ends too early is read up to there: see cut_off_bytes. `done`, here and
/// below, is called with the progress. Of more than `most_frames` frames, all of which are checked,
/// blocks spread over the recording are kept.
Recording read_recording(const std::filesystem::path& file, const ProgressCallback& done = {},
                         std::size_t most_frames = all_frames);

/// The same for text in memory; messages name the file as `name`.
Recording parse_csv(std::string_view text, const std::string& name,
                    const ProgressCallback& done = {}, std::size_t most_frames = all_frames);

/// Writes CSV for ".csv" or "-" (standard output), an LCM event log for ".lcm" and ".log". Throws
/// InputError for any other name, or if the file cannot be written.
void write_recording(const Recording& recording, const std::filesystem::path& file,
                     const ProgressCallback& done = {});

/// CSV: time_s exact to the nanosecond, values that read back to the bit but for the sign of zeros,
/// no sequence numbers (a CSV file counts from 0).
void write_csv(const Recording& recording, std::ostream& out, const ProgressCallback& done = {});

/// Appends events to an LCM event log, compatible with lcm-logplayer.
class LogWriter {
 public:
  /// Creates or empties `file` and locks it until it is closed. Throws InputError on failure, and
  /// if another writer holds it, which leaves it as it is.
  explicit LogWriter(const std::filesystem::path& file);
  ~LogWriter();
  LogWriter(LogWriter&&) noexcept;
  LogWriter& operator=(LogWriter&&) noexcept;

  /// False on failure (see errno), and from then on until the next flush.
  [[nodiscard]] bool append(const std::string& channel, std::span<const std::uint8_t> bytes,
                            std::int64_t time_us);
  /// True if everything appended since the last flush is in the file. Otherwise none of it is: the
  /// file ends at the last successful flush, so that it can be read and continued.
  [[nodiscard]] bool flush();
  /// Waits until the last successful flush is on the disk; false (see errno) on failure. True for
  /// pipes and devices.
  [[nodiscard]] bool sync();
  /// Allocates disk space for `bytes` beyond those written, so that a full disk cannot refuse
  /// them; false (see errno) if the disk has no space for them. True without effect for pipes,
  /// devices and file systems that cannot allocate ahead.
  [[nodiscard]] bool reserve(std::uint64_t bytes);
  /// Whether the file's name still leads to it.
  enum class Place : std::uint8_t { unchanged, moved, deleted };
  Place place() const;
  /// Flushes and closes, without what was reserved; false on failure. Further appends fail.
  [[nodiscard]] bool close();
  /// Size of the file, including data not yet flushed.
  std::uint64_t bytes_written() const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// Writes a log: the description, then blocks of `frames_per_block` frames.
void write_log(const Recording& recording, const std::filesystem::path& file,
               std::size_t frames_per_block = 10, const ProgressCallback& done = {});

}  // namespace stickslip::protocol
