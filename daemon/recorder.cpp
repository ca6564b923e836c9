// An LCM event log as an outlet.
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

#include "daemon/messages.h"
#include "daemon/outlet.h"
#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/decode.h"
#include "protocol/recording.h"
#include "protocol/recording_log.h"
#include "protocol/recording_parts.h"

namespace stickslip::daemon {
namespace {

using Clock = std::chrono::steady_clock;

// Where a part cannot be begun, because the disk is full or the folder is gone.
constexpr auto rotation_patience = std::chrono::seconds(1);

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

/// A log that is there already holds somebody's measurements, for example those of a daemon that
/// was killed and begins anew: it goes out of the way, to a name with the time of its last change.
void keep_what_is_there(const std::filesystem::path& file) {
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
                      "holds a recording already, which cannot be moved to " + kept.string() +
                          ": " + error.message()});
  }
  spdlog::warn("{} was there already: kept as {}", file.string(), kept.string());
}

protocol::LogWriter begin_log(const std::filesystem::path& file) {
  keep_what_is_there(file);
  return protocol::LogWriter(file);
}

/// So that after a power cut the folder knows the name of a new log. An error here is none of the
/// recording: some file systems cannot, and the log itself is synced and watched.
void sync_folder_of(const std::filesystem::path& file) {
  const std::string folder = file.has_parent_path() ? file.parent_path().string() : ".";
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  ::fsync(descriptor);
  ::close(descriptor);
}

/// All of it happens in the recorder's own thread.
class LogOutlet final : public Outlet {
 public:
  LogOutlet(std::filesystem::path file, const RecorderSettings& settings)
      : file_(std::move(file)), settings_(settings), name_(file_.string()), log_(begin_log(file_)) {
    if (settings_.sync_s <= 0.0) return;
    sync_folder_of(file_);
    if (settings_.ledger != nullptr) settings_.ledger->recorded().confirm(0);
  }

  bool put(const std::string& channel, std::span<const std::uint8_t> bytes,
           std::int64_t time_us) override {
    // Players and seekers expect times that do not go back; where rig time runs faster than the
    // wall clock, messages of the wall's time would.
    latest_us_ = std::max(latest_us_, time_us);
    const bool frames = channel == protocol::frames_channel;
    if (channel == protocol::recording_channel && !info_) {
      recording_info_t info{};
      if (protocol::decode(bytes, info)) info_ = std::move(info);
      if (info_) return begun() || told(false);
    }
    if (channel == protocol::status_channel) protocol::decode(bytes, status_);
    if (frames && unsettled_frames_ == 0 && is_due()) rotate();
    const bool taken = begun() && log_.append(channel, bytes, latest_us_);
    if (frames && taken) {
      if (!part_began_us_) part_began_us_ = latest_us_;
      unsettled_frames_ += protocol::frames_in(bytes);
    }
    // Taken is not yet written: that it works again is known when it has settled.
    return taken || told(false);
  }

  bool settle() override {
    const bool written = log_.flush();
    if (written) {
      frames_ += unsettled_frames_;
    } else if (log_.bytes_written() == 0) {
      begun_ = false;  // not even the description: it has to be first
    }
    unsettled_frames_ = 0;
    const bool worked = told(written);
    if (written && is_time_to_sync()) sync(log_);
    return worked;
  }

  bool wants_to_settle() const override { return unsettled_frames_ > 0 && is_due(); }

  bool close() override {
    const bool written = log_.flush();
    if (written && settings_.sync_s > 0.0) sync(log_);
    return told(log_.close() && written) && synced_well_;
  }

 private:
  /// The description is the first event of every part.
  bool begun() {
    if (!begun_ && info_) begun_ = append_info(log_, *info_);
    return begun_ || !info_;
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

  /// Ends this part and begins the next; where that cannot be, this one goes on. Everything that
  /// was put has settled, so its ledger is that of the frames in it.
  void rotate() {
    recording_info_t next = *info_;
    next.part += 1;
    next.previous_part = protocol::part_file(file_, info_->part).filename().string();
    next.frames_before = frames_;
    const std::filesystem::path file = protocol::part_file(file_, next.part);
    rotate_again_ = Clock::now() + rotation_patience;
    try {
      protocol::LogWriter log = begin_log(file);
      if (!append_info(log, next) || !log.flush() || !end_part()) {
        std::error_code none;
        std::filesystem::remove(file, none);
        told(false);
        return;
      }
      if (settings_.sync_s > 0.0) {
        sync(log_);
        sync_folder_of(file);
      }
      static_cast<void>(log_.close());  // all of it was flushed
      log_ = std::move(log);
    } catch (const InputError& error) {
      if (told_of_rotation_) return;
      told_of_rotation_ = true;
      spdlog::error("{}: the part before goes on", error.what());
      return;
    }
    name_ = file.string();
    info_ = std::move(next);
    part_began_us_.reset();
    rotate_again_ = {};
    told_of_rotation_ = false;
    spdlog::info("recording goes on in {}", name_);
  }

  /// The last word of a part: the latest status, with the books as they are now.
  bool end_part() {
    if (settings_.ledger != nullptr) {
      status_t last = status_;
      const std::int64_t now_us = utc_now_us();
      if (last.utc_us > 0) last.uptime_ns += 1000 * (now_us - last.utc_us);
      if (last.state.empty()) last.state = name_of(RigState::idle);
      last.utc_us = now_us;
      set_ledger(settings_.ledger->balance(), last);
      if (!log_.append(protocol::status_channel, encoded(last), latest_us_)) {
        static_cast<void>(log_.flush());  // it goes back to where it can go on
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
    // What a failed call was about stays in doubt, whatever later ones say: the kernel tells of a
    // lost write once.
    const std::int64_t frames = frames_ - asked_about_;
    asked_about_ = frames_;
    if (worked && settings_.ledger != nullptr) {
      settings_.ledger->recorded().confirm(static_cast<std::uint64_t>(frames));
    }
    if (worked || !synced_well_) return;
    synced_well_ = false;
    spdlog::error("{}: the disk does not confirm what was written: {}; a power cut may cost it",
                  name_, std::strerror(errno));
  }

  /// Says once when the disk begins to refuse, and once when it takes again.
  bool told(bool worked) {
    if (worked == working_) return worked;
    working_ = worked;
    if (worked) {
      spdlog::info("recording into {} works again", name_);
    } else {
      spdlog::error("recording into {} fails: {}; the rig goes on, the loss is counted", name_,
                    std::strerror(errno));
    }
    return worked;
  }

  std::filesystem::path file_;  // of the first part
  RecorderSettings settings_;
  std::string name_;  // of this part
  protocol::LogWriter log_;
  std::optional<recording_info_t> info_;  // of this part
  status_t status_{};                     // the latest
  bool begun_ = false;                    // the description is in the file
  std::int64_t latest_us_ = 0;
  std::optional<std::int64_t> part_began_us_;  // the first block of this part
  std::int64_t frames_ = 0;                    // that are in the files for good
  std::int64_t unsettled_frames_ = 0;
  std::int64_t asked_about_ = 0;  // of frames_, how many the disk was asked to confirm
  Clock::time_point rotate_again_;
  Clock::time_point synced_ = Clock::now();
  std::uint64_t synced_bytes_ = 0;
  bool synced_well_ = true;
  bool working_ = true;
  bool told_of_rotation_ = false;
};

}  // namespace

std::unique_ptr<Outlet> open_log(const std::filesystem::path& file,
                                 const RecorderSettings& settings) {
  if (file.extension() == ".csv") {
    throw InputError({file.string(), 0, 0,
                      "the daemon records LCM event logs, not CSV; record into '" +
                          std::filesystem::path(file).replace_extension(".log").string() +
                          "' and convert that: stickslip convert LOG CSV"});
  }
  return std::make_unique<LogOutlet>(file, settings);
}

}  // namespace stickslip::daemon
