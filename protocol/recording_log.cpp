// SPDX-License-Identifier: Apache-2.0
#include "protocol/recording_log.h"

#include <fcntl.h>
#include <lcm/eventlog.h>
#include <stdio_ext.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <stickslip/frame_block_t.hpp>
#include <vector>

#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/decode.h"
#include "protocol/frame_block.h"
#include "protocol/log_lock.h"
#include "protocol/recording_events.h"
#include "protocol/sha256.h"
#include "protocol/spread_frames.h"

namespace stickslip::protocol {

namespace {

struct CloseLog {
  void operator()(lcm_eventlog_t* log) const { lcm_eventlog_destroy(log); }
};
using Log = std::unique_ptr<lcm_eventlog_t, CloseLog>;

[[noreturn]] void refuse(const std::string& name, std::int64_t byte, const std::string& message) {
  throw InputError(Problem{name, 0, 0, "at byte " + std::to_string(byte) + ": " + message});
}

[[noreturn]] void refuse_damage(const std::string& name, std::int64_t byte,
                                const std::string& message) {
  refuse(name, byte,
         message + "; `stickslip log repair " + name + " --out OTHER.log` keeps the intact events");
}

}  // namespace

Recording read_log(const std::filesystem::path& file, const ProgressCallback& done,
                   std::size_t most_frames) {
  std::ifstream in(file, std::ios::binary);
  if (!in) {
    throw InputError(
        Problem{file.string(), 0, 0, std::string("cannot be read: ") + std::strerror(errno)});
  }
  return parse_log(in, file.string(), done, most_frames);
}

Recording parse_log(std::istream& in, const std::string& name, const ProgressCallback& done,
                    std::size_t most_frames) {
  EventReader reader(in, name, done);
  Recording recording;
  recording.source = name;
  frame_block_t block;
  recording_info_t info;
  event_t note;
  LogEvent event;
  SpreadFrames frames(most_frames);
  std::vector<Frame> decoded;
  std::int64_t last_ns = 0;
  const auto take_frames = [&] {
    decoded.clear();
    if (!decode(event.data, block) || !from_block(block, decoded)) {
      refuse_damage(
          name, event.at,
          "a message on " + event.channel + " is damaged, or not a frame_block_t of this version");
    }
    for (const Frame& frame : decoded) {
      if (frames.count() > 0 && frame.time_ns <= last_ns) {
        refuse(name, event.at,
               "time does not increase: " + std::to_string(frame.time_ns) + " ns after " +
                   std::to_string(last_ns) + " ns");
      }
      last_ns = frame.time_ns;
      frames.add(frame);
      recording.channels |= frame.valid;
    }
  };
  while (true) {
    const EventReader::Found found = reader.next(event);
    if (found == EventReader::Found::end) break;
    if (found == EventReader::Found::damage) {
      refuse_damage(name, event.at, "damaged: " + reader.why());
    }
    if (found == EventReader::Found::cut_off) {
      recording.cut_off_bytes = static_cast<std::uint64_t>(event.end - event.at);
    } else if (event.channel == frames_channel) {
      take_frames();
    } else if (event.channel == recording_channel) {
      if (!decode(event.data, info)) {
        refuse_damage(name, event.at,
                      "a message on " + event.channel +
                          " is damaged, or not a recording_info_t of this version");
      }
      recording.description = description_of(info);
    } else if (event.channel == event_channel && decode(event.data, note) &&
               note.code == model_changed_code) {
      recording.model_changes.push_back({note.time_ns, note.message});
    }
  }
  frames.finish(recording);
  if (recording.frames.empty()) {
    throw InputError(Problem{
        name, 0, 0, std::string("has no frames: nothing was recorded on ") + frames_channel});
  }
  if (recording.channels == 0) {
    throw InputError(Problem{name, 0, 0, "has no values: no channel of its frames is valid"});
  }
  return recording;
}

recording_info_t info_of(const Description& description, std::int64_t frames) {
  const auto digest = [](const std::string& text) {
    return text.empty() ? std::string() : sha256_of(text);
  };
  recording_info_t info{};
  info.schema = log_schema;
  info.started_utc_us = description.started_utc_us;
  info.rig = description.rig;
  info.program = description.program;
  info.version = description.version;
  info.configuration = description.configuration;
  info.model = description.model;
  info.calibration = description.calibration;
  info.configuration_sha256 = digest(description.configuration);
  info.model_sha256 = digest(description.model);
  info.calibration_sha256 = digest(description.calibration);
  info.part = description.part;
  info.previous_part = description.previous_part;
  info.frames_before = description.frames_before;
  info.frames = frames;
  info.fault_script = description.fault_script;
  info.fault_script_sha256 = digest(description.fault_script);
  return info;
}

std::int64_t frames_in(std::span<const std::uint8_t> block) {
  constexpr std::size_t after_the_type = 8;
  if (block.size() < after_the_type + 4) return 0;
  std::uint32_t count = 0;
  for (std::size_t i = 0; i < 4; ++i) count = count << 8U | block[after_the_type + i];
  return static_cast<std::int32_t>(count);
}

Description description_of(const recording_info_t& info) {
  Description description;
  description.started_utc_us = info.started_utc_us;
  description.rig = info.rig;
  description.program = info.program;
  description.version = info.version;
  description.configuration = info.configuration;
  description.model = info.model;
  description.calibration = info.calibration;
  description.part = info.part;
  description.previous_part = info.previous_part;
  description.frames_before = info.frames_before;
  description.fault_script = info.fault_script;
  return description;
}

namespace {

bool is_one_file(const struct stat& a, const struct stat& b) {
  return a.st_dev == b.st_dev && a.st_ino == b.st_ino;
}

/// The log, locked. Opened for appending, so that nothing is emptied before it is locked.
Log open_locked(const std::filesystem::path& file) {
  while (true) {
    errno = 0;
    Log log(lcm_eventlog_create(file.c_str(), "a"));
    if (!log) {
      throw InputError(Problem{
          file.string(), 0, 0,
          std::string("cannot be written: ") + std::strerror(errno) + "; does its folder exist?"});
    }
    const int descriptor = fileno(log->f);
    ::fcntl(descriptor, F_SETFD, FD_CLOEXEC);
    lock_log(descriptor, file);
    struct stat opened {};
    struct stat named {};
    // Its previous writer may have renamed it before the lock.
    if (::fstat(descriptor, &opened) == 0 && ::stat(file.c_str(), &named) == 0 &&
        is_one_file(opened, named)) {
      return log;
    }
  }
}

}  // namespace

struct LogWriter::Implementation {
  std::filesystem::path file;
  // One system call per buffer instead of one per page. Declared before the log, which uses it
  // until it is closed.
  std::vector<char> buffer = std::vector<char>(std::size_t{1} << 18U);
  Log log;
  std::uint64_t bytes = 0;
  bool refused = false;  // since the last flush
  // State after the last successful flush.
  std::uint64_t safe_bytes = 0;
  std::int64_t safe_events = 0;
  std::uint64_t reserved = 0;  // end of the space allocated on the disk
  bool can_reserve = true;

  // Drops incomplete data. True if the file can be continued.
  bool go_back() {
    std::FILE* file = log->f;
    __fpurge(file);
    std::clearerr(file);
    const auto end = static_cast<off_t>(safe_bytes);
    if (ftruncate(fileno(file), end) != 0 || fseeko(file, end, SEEK_SET) != 0) return false;
    bytes = safe_bytes;
    reserved = safe_bytes;
    log->eventcount = safe_events;
    return true;
  }
};

LogWriter::LogWriter(const std::filesystem::path& file)
    : implementation_(std::make_unique<Implementation>()) {
  implementation_->file = std::filesystem::absolute(file);
  implementation_->log = open_locked(file);
  const int descriptor = fileno(implementation_->log->f);
  if (::ftruncate(descriptor, 0) != 0 && errno != EINVAL) {
    throw InputError(
        Problem{file.string(), 0, 0, std::string("cannot be emptied: ") + std::strerror(errno)});
  }
  std::setvbuf(implementation_->log->f, implementation_->buffer.data(), _IOFBF,
               implementation_->buffer.size());
}

LogWriter::~LogWriter() = default;
LogWriter::LogWriter(LogWriter&&) noexcept = default;
LogWriter& LogWriter::operator=(LogWriter&&) noexcept = default;

bool LogWriter::append(const std::string& channel, std::span<const std::uint8_t> bytes,
                       std::int64_t time_us) {
  if (!implementation_->log || implementation_->refused) return false;
  // liblcm takes mutable pointers to data that it only reads.
  lcm_eventlog_event_t event{};
  event.timestamp = time_us;
  event.channellen = static_cast<std::int32_t>(channel.size());
  event.datalen = static_cast<std::int32_t>(bytes.size());
  event.channel =
      const_cast<char*>(channel.data());  // NOLINT(cppcoreguidelines-pro-type-const-cast)
  event.data =
      const_cast<std::uint8_t*>(bytes.data());  // NOLINT(cppcoreguidelines-pro-type-const-cast)
  if (lcm_eventlog_write_event(implementation_->log.get(), &event) != 0) {
    implementation_->refused = true;
    return false;
  }
  implementation_->bytes +=
      static_cast<std::uint64_t>(event_header_bytes) + channel.size() + bytes.size();
  return true;
}

bool LogWriter::flush() {
  Implementation& i = *implementation_;
  if (!i.log) return false;
  if (!i.refused && std::fflush(i.log->f) == 0 && std::ferror(i.log->f) == 0) {
    i.safe_bytes = i.bytes;
    i.safe_events = i.log->eventcount;
    return true;
  }
  const int why = errno;
  i.refused = !i.go_back();
  errno = why;
  return false;
}

bool LogWriter::sync() {
  const Implementation& i = *implementation_;
  if (!i.log) return false;
  // Pipes and devices cannot be synchronised.
  return fdatasync(fileno(i.log->f)) == 0 || errno == EINVAL || errno == EROFS;
}

bool LogWriter::reserve(std::uint64_t bytes) {
  constexpr std::uint64_t step = std::uint64_t{1} << 20U;
  Implementation& i = *implementation_;
  if (!i.log) return false;
  const std::uint64_t wanted = i.bytes + bytes;
  if (!i.can_reserve || wanted <= i.reserved) return true;
  for (const std::uint64_t ahead : {step, std::uint64_t{0}}) {
    const auto length = static_cast<off_t>(wanted + ahead - i.reserved);
    if (::fallocate(fileno(i.log->f), FALLOC_FL_KEEP_SIZE, static_cast<off_t>(i.reserved),
                    length) == 0) {
      i.reserved = wanted + ahead;
      return true;
    }
    if (errno == ENOSPC || errno == EDQUOT || errno == EFBIG) continue;
    if (errno != EINTR) i.can_reserve = false;
    return true;
  }
  return false;
}

LogWriter::Place LogWriter::place() const {
  const Implementation& i = *implementation_;
  struct stat opened {};
  if (!i.log) return Place::unchanged;
  if (::fstat(fileno(i.log->f), &opened) != 0) return Place::deleted;
  if (!S_ISREG(opened.st_mode)) return Place::unchanged;
  struct stat named {};
  if (::stat(i.file.c_str(), &named) == 0 && is_one_file(opened, named)) return Place::unchanged;
  return opened.st_nlink == 0 ? Place::deleted : Place::moved;
}

bool LogWriter::close() {
  const bool flushed = flush();
  Implementation& i = *implementation_;
  if (flushed && i.reserved > i.safe_bytes) {
    // A failure costs space only.
    static_cast<void>(::ftruncate(fileno(i.log->f), static_cast<off_t>(i.safe_bytes)) == 0);
  }
  implementation_->log.reset();
  return flushed;
}

std::uint64_t LogWriter::bytes_written() const { return implementation_->bytes; }

namespace {

template <class Message>
std::vector<std::uint8_t> encoded(const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

}  // namespace

void write_log(const Recording& recording, const std::filesystem::path& file,
               std::size_t frames_per_block, const ProgressCallback& done) {
  LogWriter writer(file);
  const auto require = [&](bool written) {
    if (!written) {
      throw InputError(
          Problem{file.string(), 0, 0, std::string("cannot be written: ") + std::strerror(errno)});
    }
  };
  const recording_info_t info =
      info_of(recording.description, static_cast<std::int64_t>(recording.frames.size()));
  const auto time_us = [](const Frame& frame) { return frame.time_ns / 1000; };
  require(writer.append(recording_channel, encoded(info),
                        recording.frames.empty() ? 0 : time_us(recording.frames.front())));
  frame_block_t block;
  const std::span<const Frame> frames(recording.frames);
  for (std::size_t first = 0; first < frames.size(); first += frames_per_block) {
    if (done) done(static_cast<double>(first) / static_cast<double>(frames.size()));
    const auto some = frames.subspan(first, std::min(frames_per_block, frames.size() - first));
    to_block(some, block);
    require(writer.append(frames_channel, encoded(block), time_us(some.back())));
  }
  require(writer.close());
}

}  // namespace stickslip::protocol
