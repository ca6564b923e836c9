// The recorder: messages in an LCM event log.
#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
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
#include "protocol/recording.h"
#include "protocol/recording_log.h"
#include "protocol/recording_parts.h"

namespace stickslip::daemon {
namespace {

using Clock = std::chrono::steady_clock;

// Before another attempt to begin a part, after one that failed: full disk, missing folder.
constexpr auto rotation_retry = std::chrono::seconds(1);

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

/// Renames an existing log, for example that of a daemon that was killed and restarted, to a name
/// with the time of its last change.
void keep_existing(const std::filesystem::path& file) {
  namespace fs = std::filesystem;
  std::error_code error;
  if (fs::symlink_status(file, error).type() != fs::file_type::regular ||
      fs::file_size(file, error) == 0) {
    return;
  }
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
  fs::rename(file, kept, error);
  if (error) {
    throw InputError({file.string(), 0, 0,
                      "already holds a recording, which cannot be renamed to " + kept.string() +
                          ": " + error.message()});
  }
  spdlog::warn("{} already exists: kept as {}", file.string(), kept.string());
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
    if (channel == protocol::recording_channel && !info_) {
      recording_info_t info{};
      if (protocol::decode(bytes, info)) info_ = std::move(info);
      if (info_) return write_info() || report(false);
    }
    if (channel == protocol::status_channel) protocol::decode(bytes, status_);
    if (frames && unflushed_frames_ == 0 && is_due()) rotate();
    const bool appended = write_info() && log_.append(channel, bytes, latest_us_);
    if (frames && appended) {
      if (!part_began_us_) part_began_us_ = latest_us_;
      unflushed_frames_ += protocol::frames_in(bytes);
    }
    // An append is only buffered: recovery is reported by a successful flush.
    return appended || report(false);
  }

  bool flush() override {
    const bool written = log_.flush();
    if (written) {
      frames_ += unflushed_frames_;
    } else if (log_.bytes_written() == 0) {
      info_written_ = false;  // not even the description, which has to be first
    }
    unflushed_frames_ = 0;
    const bool working = report(written);
    if (written && is_time_to_sync()) sync(log_);
    return working;
  }

  bool wants_flush() const override { return unflushed_frames_ > 0 && is_due(); }

  bool close() override {
    const bool written = log_.flush();
    if (written && settings_.sync_s > 0.0) sync(log_);
    return report(log_.close() && written) && all_synced_;
  }

 private:
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
    recording_info_t next = *info_;
    next.part += 1;
    next.previous_part = protocol::part_file(file_, info_->part).filename().string();
    next.frames_before = frames_;
    const std::filesystem::path file = protocol::part_file(file_, next.part);
    rotate_again_ = Clock::now() + rotation_retry;
    try {
      protocol::LogWriter log = begin_log(file);
      if (!append_info(log, next) || !log.flush() || !end_part()) {
        std::error_code none;
        std::filesystem::remove(file, none);
        report(false);
        return;
      }
      if (settings_.sync_s > 0.0) {
        sync(log_);
        sync_folder_of(file);
      }
      static_cast<void>(log_.close());  // all of it was flushed
      log_ = std::move(log);
    } catch (const InputError& error) {
      if (rotation_failure_reported_) return;
      rotation_failure_reported_ = true;
      spdlog::error("{}: recording continues in the previous part", error.what());
      return;
    }
    name_ = file.string();
    info_ = std::move(next);
    part_began_us_.reset();
    rotate_again_ = {};
    rotation_failure_reported_ = false;
    spdlog::info("recording continues in {}", name_);
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
    spdlog::error("{}: the disk did not confirm what was written: {}; a power cut may lose it",
                  name_, std::strerror(errno));
  }

  /// Logs the first failure of a row, and the recovery. Returns `worked`.
  bool report(bool worked) {
    if (worked == working_) return worked;
    working_ = worked;
    if (worked) {
      spdlog::info("recording into {} works again", name_);
    } else {
      spdlog::error(
          "recording into {} fails: {}; the rig keeps running and the lost frames are counted",
          name_, std::strerror(errno));
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
  bool rotation_failure_reported_ = false;
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
  return std::make_unique<RecordingWriter>(file, settings);
}

}  // namespace stickslip::daemon
