// SPDX-License-Identifier: Apache-2.0
// The recorder: messages in an LCM event log.
#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
#include <mutex>
#include <optional>
#include <stickslip/recording_info_t.hpp>
#include <stickslip/status_t.hpp>
#include <utility>
#include <vector>

#include "daemon/message_writer.h"
#include "daemon/messages.h"
#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/decode.h"
#include "protocol/log_lock.h"
#include "protocol/recording.h"
#include "protocol/recording_log.h"
#include "protocol/recording_parts.h"

namespace stickslip::daemon {
namespace {

using Clock = std::chrono::steady_clock;

// Before another attempt to begin a part, after one that failed: full disk, missing folder.
constexpr auto rotation_retry = std::chrono::seconds(1);

/// Disk space that only events and the last status may use: about a thousand of them.
constexpr std::uint64_t reserve_bytes = std::uint64_t{256} << 10U;

std::int64_t utc_now_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

template <class Type>
std::vector<std::uint8_t> encoded(const Type& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

/// A name for an existing log with the time of its last change, which no file has.
std::filesystem::path kept_name(const std::filesystem::path& file) {
  namespace fs = std::filesystem;
  std::error_code error;
  const auto changed = std::chrono::file_clock::to_sys(fs::last_write_time(file, error));
  const std::time_t when = std::chrono::system_clock::to_time_t(
      std::chrono::time_point_cast<std::chrono::system_clock::duration>(changed));
  std::tm utc{};
  gmtime_r(&when, &utc);
  std::string stamp(16, '\0');
  stamp.resize(std::strftime(stamp.data(), stamp.size() + 1, "%Y%m%dT%H%M%SZ", &utc));
  fs::path kept;
  for (int n = 0; n == 0 || fs::exists(kept, error); ++n) {
    kept =
        file.parent_path() / (file.stem().string() + '.' + stamp +
                              (n == 0 ? "" : '-' + std::to_string(n)) + file.extension().string());
  }
  return kept;
}

/// Renames an existing log, for example that of a daemon that was killed and restarted. One that is
/// being written is refused.
void keep_existing(const std::filesystem::path& file) {
  namespace fs = std::filesystem;
  std::error_code error;
  if (fs::is_symlink(file, error) && fs::is_regular_file(file, error)) {
    return keep_existing(fs::canonical(file));
  }
  if (fs::symlink_status(file, error).type() != fs::file_type::regular ||
      fs::file_size(file, error) == 0) {
    return;
  }
  protocol::require_free_log(file);
  const fs::path kept = kept_name(file);
  fs::rename(file, kept, error);
  if (error) {
    throw InputError({file.string(), 0, 0,
                      "already holds a recording, which cannot be renamed to " + kept.string() +
                          ": " + error.message()});
  }
  spdlog::warn("{} already exists: kept as {}", file.string(), kept.string());
}

/// Throws if a part that the folder has now is being written.
void require_present_parts_free(const std::filesystem::path& file) {
  namespace fs = std::filesystem;
  const std::string begin = file.stem().string() + '.';
  std::error_code error;
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    const fs::path& other = at->path();
    const std::string stem = other.stem().string();
    if (other.extension() != file.extension() || !stem.starts_with(begin)) continue;
    if (stem.find_first_not_of("0123456789", begin.size()) != std::string::npos) continue;
    protocol::require_free_log(other);
  }
}

/// Another daemon may have rotated away from the log of that name and be writing a later part. One
/// that it begins while the folder is read is found the second time: it locks it before it releases
/// the part before.
void require_free_parts(const std::filesystem::path& file) {
  require_present_parts_free(file);
  require_present_parts_free(file);
}

protocol::LogWriter begin_log(const std::filesystem::path& file) {
  keep_existing(file);
  return protocol::LogWriter(file);
}

/// Makes the name of a new log survive a power cut. Errors are ignored: some file systems do not
/// support it, and the log itself is synced and checked.
void sync_folder_of(const std::filesystem::path& file) {
  const std::string folder = file.has_parent_path() ? file.parent_path().string() : ".";
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  ::fsync(descriptor);
  ::close(descriptor);
}

/// Used by the recorder's thread only.
class RecordingWriter final : public MessageWriter {
 public:
  RecordingWriter(std::filesystem::path file, const RecorderSettings& settings)
      : file_(std::move(file)), settings_(settings), name_(file_.string()), log_(begin_log(file_)) {
    if (settings_.sync_s <= 0.0) return;
    sync_folder_of(file_);
    if (settings_.ledger != nullptr) settings_.ledger->recorded().confirm(0);
  }

  bool write(const std::string& channel, std::span<const std::uint8_t> bytes,
             std::int64_t time_us) override {
    // Players expect times that never decrease; with rig time faster than the wall clock, messages
    // stamped with wall time would go back.
    latest_us_ = std::max(latest_us_, time_us);
    const bool frames = channel == protocol::frames_channel;
    if (channel == protocol::recording_channel) {
      recording_info_t info{};
      if (protocol::decode(bytes, info)) return describe(std::move(info)) || report(false);
    }
    const bool status = channel == protocol::status_channel;
    if (status) protocol::decode(bytes, status_);
    if (frames && unflushed_frames_ == 0 && is_due()) rotate();
    const bool appended = channel != protocol::event_channel && !has_space(bytes.size())
                              ? false
                              : write_info() && log_.append(channel, bytes, latest_us_);
    if (status) status_withheld_ = !appended;
    if (frames && appended) {
      if (!part_began_us_) part_began_us_ = latest_us_;
      if (!began_us_) began_us_ = latest_us_;
      unflushed_frames_ += protocol::frames_in(bytes);
    }
    // An append is only buffered: recovery is reported by a successful flush.
    return appended || report(false);
  }

  bool flush() override {
    const bool in_file = log_.flush();
    if (!in_file && log_.bytes_written() == 0) {
      info_written_ = false;  // not even the description, which has to be first
    }
    // With space to spare, so that a few bytes do not end what the next block begins again.
    if (full_) full_ = !log_.reserve(2 * reserve_bytes);
    report(in_file && !full_);
    const Place place = log_.place();
    const bool written = in_file && place != Place::deleted;
    if (written) frames_ += unflushed_frames_;
    unflushed_frames_ = 0;
    if (written && is_time_to_sync()) sync(log_);
    if (place == Place::unchanged) {
      missing_reported_ = false;
    } else {
      replace(place);
    }
    note_progress();
    return written;
  }

  bool wants_flush() const override { return unflushed_frames_ > 0 && is_due(); }

  bool close() override {
    if (status_withheld_) static_cast<void>(end_part());
    const bool written = log_.flush();
    if (written && settings_.sync_s > 0.0) sync(log_);
    const bool in_place = log_.place() != Place::deleted && !missing_reported_;
    return report(log_.close() && written) && all_synced_ && in_place;
  }

  std::vector<Event> take_events() override {
    const std::lock_guard lock(shared_lock_);
    return std::exchange(events_, {});
  }

  std::optional<RecordingProgress> progress() const override {
    const std::lock_guard lock(shared_lock_);
    return progress_;
  }

 private:
  using Place = protocol::LogWriter::Place;

  /// False (see errno) if the disk has no space for so much besides the reserve. Asked again after
  /// the next flush.
  bool has_space(std::size_t bytes) {
    if (!full_ && !log_.reserve(reserve_bytes + bytes)) {
      full_ = true;
      refusal_ = errno;
    }
    if (full_) errno = refusal_;
    return !full_;
  }

  /// The first description begins the log. A later one, of a rig whose model was changed, stands
  /// where it came, and is that of the next parts.
  bool describe(recording_info_t info) {
    if (!info_) {
      info_ = std::move(info);
      return write_info();
    }
    info.part = info_->part;
    info.previous_part = info_->previous_part;
    info.frames_before = info_->frames_before;
    info_ = std::move(info);
    if (!info_written_) return write_info();
    return append_info(log_, *info_);
  }

  /// The description is the first event of every part.
  bool write_info() {
    if (!info_written_ && info_) info_written_ = append_info(log_, *info_);
    return info_written_ || !info_;
  }

  bool append_info(protocol::LogWriter& log, const recording_info_t& info) const {
    return log.append(protocol::recording_channel, encoded(info), latest_us_);
  }

  bool is_due() const {
    if (!info_ || !part_began_us_ || Clock::now() < rotate_again_) return false;
    const auto lasted_s = static_cast<double>(latest_us_ - *part_began_us_) * 1e-6;
    return (settings_.rotate_s && lasted_s >= *settings_.rotate_s) ||
           (settings_.rotate_mb &&
            static_cast<double>(log_.bytes_written()) >= *settings_.rotate_mb * 1e6);
  }

  /// Ends this part and begins the next; if that fails, this one continues. Everything written has
  /// been flushed, so that its ledger is that of the frames in it.
  void rotate() {
    const std::filesystem::path file = protocol::part_file(file_, info_->part + 1);
    rotate_again_ = Clock::now() + rotation_retry;
    const std::string failure = begin_part(file, true);
    if (failure.empty()) {
      rotate_again_ = {};
      rotation_failure_reported_ = false;
      spdlog::info("recording continues in {}", name_);
    } else if (!std::exchange(rotation_failure_reported_, true)) {
      add_event(Severity::warning, "rotation_failed",
                failure + ": the recording continues in the previous part");
    }
  }

  /// Begins the next part in `file`. `end_previous`: not without the last event of this part.
  /// Returns the error, and then nothing has changed; empty: this part is closed.
  std::string begin_part(const std::filesystem::path& file, bool end_previous) {
    try {
      protocol::LogWriter log = begin_log(file);
      recording_info_t next;
      bool begun = true;
      if (info_) {
        next = *info_;
        next.part += 1;
        next.previous_part = std::filesystem::path(name_).filename().string();
        next.frames_before = frames_;
        begun = append_info(log, next) && log.reserve(reserve_bytes) && log.flush();
      }
      if (!begun || (!end_part() && end_previous)) {
        const std::string why = std::strerror(errno);
        std::error_code none;
        std::filesystem::remove(file, none);
        return file.string() + " cannot be written: " + why;
      }
      if (settings_.sync_s > 0.0) {
        if (end_previous) sync(log_);
        sync_folder_of(file);
      }
      static_cast<void>(log_.close());  // all of it was flushed
      earlier_bytes_ += log_.bytes_written();
      log_ = std::move(log);
      if (info_) info_ = std::move(next);
      info_written_ = info_.has_value();
    } catch (const InputError& error) {
      return error.what();
    }
    name_ = file.string();
    part_began_us_.reset();
    full_ = false;
    return {};
  }

  /// After the log was deleted, moved, or covered by another disk: begins it anew at its path.
  void replace(Place place) {
    const bool deleted = place == Place::deleted;
    if (Clock::now() < replace_again_) return;
    replace_again_ = Clock::now() + rotation_retry;
    const std::string what =
        name_ + (deleted
                     ? " was deleted: what was recorded in it is lost"
                     : " is not in its place (moved, unmounted, or covered by another disk): what "
                       "was recorded in it is where it is now");
    const std::string failure = begin_part(name_, false);
    if (failure.empty()) {
      replace_again_ = {};
      missing_reported_ = false;
      add_event(deleted ? Severity::error : Severity::warning, "log_begun_anew",
                what + "; the recording continues in a new log at that path, as part " +
                    std::to_string(info_ ? info_->part : 0));
    } else if (!std::exchange(missing_reported_, true)) {
      add_event(Severity::error, "log_missing",
                what + "; a new log cannot be begun: " + failure + "; tried again every second" +
                    (deleted ? ", frames are lost until it succeeds" : ""));
    }
  }

  void note_progress() {
    const std::lock_guard lock(shared_lock_);
    progress_.file = name_;
    progress_.part = info_ ? static_cast<std::int32_t>(info_->part) : 0;
    progress_.file_bytes = log_.bytes_written();
    progress_.bytes = earlier_bytes_ + progress_.file_bytes;
    progress_.length_us = latest_us_ - began_us_.value_or(latest_us_);
  }

  void add_event(Severity severity, const char* code, const std::string& message) {
    const std::lock_guard lock(shared_lock_);
    events_.push_back({severity, code, message});
  }

  /// The last event of a part: the latest status, with the current ledger.
  bool end_part() {
    if (settings_.ledger != nullptr) {
      status_t last = status_;
      const std::int64_t now_us = utc_now_us();
      if (last.utc_us > 0) last.uptime_ns += 1000 * (now_us - last.utc_us);
      if (last.state.empty()) last.state = name_of(RigState::idle);
      last.utc_us = now_us;
      set_ledger(settings_.ledger->balance(), last);
      if (!log_.append(protocol::status_channel, encoded(last), latest_us_)) {
        static_cast<void>(log_.flush());  // rewinds to the last complete event
        return false;
      }
    }
    return log_.flush();
  }

  bool is_time_to_sync() const {
    return settings_.sync_s > 0.0 &&
           std::chrono::duration<double>(Clock::now() - synced_).count() >= settings_.sync_s &&
           log_.bytes_written() != synced_bytes_;
  }

  void sync(protocol::LogWriter& log) {
    const bool worked = log.sync();
    synced_ = Clock::now();
    synced_bytes_ = log.bytes_written();
    // Frames of a failed sync stay unconfirmed even if later syncs succeed: the kernel reports a
    // lost write only once.
    const std::int64_t frames = frames_ - sync_requested_;
    sync_requested_ = frames_;
    if (worked && settings_.ledger != nullptr) {
      settings_.ledger->recorded().confirm(static_cast<std::uint64_t>(frames));
    }
    if (worked || !all_synced_) return;
    all_synced_ = false;
    add_event(Severity::error, "sync_failed",
              name_ + ": the disk did not confirm what was written: " + std::strerror(errno) +
                  "; a power cut may lose it");
  }

  /// Reports the first failure of a row (see errno), and the recovery. Returns `worked`.
  bool report(bool worked) {
    if (worked == working_) return worked;
    working_ = worked;
    if (worked) {
      add_event(Severity::info, "recording_works", "recording into " + name_ + " works again");
    } else {
      add_event(Severity::error, "recording_fails",
                "recording into " + name_ + " fails: " + std::strerror(errno) +
                    "; the rig keeps running and the lost frames are counted");
    }
    return worked;
  }

  std::filesystem::path file_;  // of the first part
  RecorderSettings settings_;
  std::string name_;  // of this part
  protocol::LogWriter log_;
  std::optional<recording_info_t> info_;  // of this part
  status_t status_{};                     // the latest
  bool info_written_ = false;
  std::int64_t latest_us_ = 0;
  std::optional<std::int64_t> part_began_us_;  // the first block of this part
  std::int64_t frames_ = 0;                    // flushed to the files
  std::int64_t unflushed_frames_ = 0;
  std::int64_t sync_requested_ = 0;  // frames_ at the latest sync
  Clock::time_point rotate_again_;
  Clock::time_point synced_ = Clock::now();
  std::uint64_t synced_bytes_ = 0;
  bool all_synced_ = true;
  bool working_ = true;
  bool full_ = false;             // the disk, but for the reserve
  int refusal_ = 0;               // errno of the full disk
  bool status_withheld_ = false;  // the latest, by a full disk
  bool rotation_failure_reported_ = false;
  bool missing_reported_ = false;
  Clock::time_point replace_again_;
  std::optional<std::int64_t> began_us_;  // the first block of all parts
  std::uint64_t earlier_bytes_ = 0;       // in earlier parts
  mutable std::mutex shared_lock_;        // of what follows; never taken by the loop
  std::vector<Event> events_;
  RecordingProgress progress_;
};

}  // namespace

std::unique_ptr<MessageWriter> open_log(const std::filesystem::path& file,
                                        const RecorderSettings& settings) {
  if (file.extension() == ".csv") {
    throw InputError({file.string(), 0, 0,
                      "the daemon records LCM event logs, not CSV; record into '" +
                          std::filesystem::path(file).replace_extension(".log").string() +
                          "' and convert that: stickslip convert LOG CSV"});
  }
  require_free_parts(file);
  return std::make_unique<RecordingWriter>(file, settings);
}

}  // namespace stickslip::daemon
