#include "protocol/recording_log.h"

#include <lcm/eventlog.h>
#include <stdio_ext.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <istream>
#include <stickslip/frame_block_t.hpp>
#include <stickslip/recording_info_t.hpp>

#include "physics/problem.h"
#include "protocol/channels.h"
#include "protocol/decode.h"
#include "protocol/frame_block.h"

namespace stickslip::protocol {

namespace {

// An event on disk: sync word, event number, time, two lengths, channel, data; big-endian.
constexpr std::int64_t event_header_bytes = 28;
constexpr std::string_view sync_word = "\xED\xA1\xDA\x01";

struct CloseLog {
  void operator()(lcm_eventlog_t* log) const { lcm_eventlog_destroy(log); }
};
using Log = std::unique_ptr<lcm_eventlog_t, CloseLog>;

// What liblcm's own reader takes for a channel name at most.
constexpr std::int64_t longest_channel = 999;

std::int64_t big_endian(std::span<const char, 4> bytes) {
  std::uint32_t value = 0;
  for (const char byte : bytes) value = value << 8U | static_cast<std::uint8_t>(byte);
  return static_cast<std::int32_t>(value);
}

[[noreturn]] void refuse(const std::string& name, std::int64_t byte, const std::string& message) {
  throw InputError(Problem{name, 0, 0, "at byte " + std::to_string(byte) + ": " + message});
}

void take_description(const recording_info_t& info, Description& description) {
  description.started_utc_us = info.started_utc_us;
  description.rig = info.rig;
  description.program = info.program;
  description.version = info.version;
  description.configuration = info.configuration;
  description.model = info.model;
}

}  // namespace

bool is_log(std::string_view head) { return head.substr(0, 4) == sync_word; }

Recording read_log(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) {
    throw InputError(
        Problem{file.string(), 0, 0, std::string("cannot be read: ") + std::strerror(errno)});
  }
  return parse_log(in, file.string());
}

// liblcm's own reader is not used: it skips what it does not understand without a word, prints some
// of it, and a length of 2^31 - 1 crashes it.
Recording parse_log(std::istream& in, const std::string& name) {
  in.seekg(0, std::ios::end);
  const std::int64_t size = in.tellg();
  in.seekg(0);
  Recording recording;
  recording.source = name;
  frame_block_t block;
  recording_info_t info;
  std::string channel;
  std::vector<std::uint8_t> data;
  std::array<char, event_header_bytes> header{};
  std::int64_t at = 0;
  const auto cut_off = [&]() {
    refuse(name, at,
           "the log is cut off: the " + std::to_string(size - at) +
               " bytes that follow are no whole event; was it copied while being written?");
  };
  while (at < size) {
    if (size - at >= 4) {
      in.read(header.data(), 4);
      if (std::string_view(header.data(), 4) != sync_word) {
        refuse(name, at, "damaged: no event begins here, where the one before ends");
      }
    }
    if (size - at < event_header_bytes) cut_off();
    in.read(header.data() + 4, event_header_bytes - 4);
    const std::int64_t channel_size = big_endian(std::span(header).subspan<20, 4>());
    const std::int64_t data_size = big_endian(std::span(header).subspan<24, 4>());
    if (channel_size < 1 || channel_size > longest_channel || data_size < 0) {
      refuse(name, at,
             "damaged: an event with a channel name of " + std::to_string(channel_size) +
                 " bytes and " + std::to_string(data_size) + " bytes of data");
    }
    const std::int64_t end = at + event_header_bytes + channel_size + data_size;
    if (end > size) cut_off();
    channel.resize(static_cast<std::size_t>(channel_size));
    data.resize(static_cast<std::size_t>(data_size));
    in.read(channel.data(), channel_size);
    in.read(reinterpret_cast<char*>(data.data()), data_size);
    if (!in) {
      throw InputError(
          Problem{name, 0, 0,
                  "at byte " + std::to_string(at) + ": cannot be read: " + std::strerror(errno)});
    }
    if (channel == frames_channel) {
      const std::size_t before = recording.frames.size();
      if (!decode(data, block) || !from_block(block, recording.frames)) {
        refuse(name, at,
               "a message on " + channel + " is damaged, or no frame_block_t of this version");
      }
      for (std::size_t i = before; i < recording.frames.size(); ++i) {
        const Frame& frame = recording.frames[i];
        if (i > 0 && frame.time_ns <= recording.frames[i - 1].time_ns) {
          refuse(name, at,
                 "time does not increase: " + std::to_string(frame.time_ns) + " ns after " +
                     std::to_string(recording.frames[i - 1].time_ns) + " ns");
        }
        recording.channels |= frame.valid;
      }
    } else if (channel == recording_channel) {
      if (!decode(data, info)) {
        refuse(name, at,
               "a message on " + channel + " is damaged, or no recording_info_t of this version");
      }
      take_description(info, recording.description);
    }
    at = end;
  }
  if (recording.frames.empty()) {
    throw InputError(Problem{
        name, 0, 0, std::string("holds no frames: nothing was recorded on ") + frames_channel});
  }
  if (recording.channels == 0) {
    throw InputError(Problem{name, 0, 0, "holds no value: no channel of its frames is valid"});
  }
  return recording;
}

struct LogWriter::Implementation {
  Log log;
  std::uint64_t bytes = 0;
  bool refused = false;  // since the last flush
  // As the last good flush left it.
  std::uint64_t safe_bytes = 0;
  std::int64_t safe_events = 0;

  // Drops what is neither whole nor wanted any more. Whether the file can be continued.
  bool go_back() {
    std::FILE* file = log->f;
    __fpurge(file);
    std::clearerr(file);
    const auto end = static_cast<off_t>(safe_bytes);
    if (ftruncate(fileno(file), end) != 0 || fseeko(file, end, SEEK_SET) != 0) return false;
    bytes = safe_bytes;
    log->eventcount = safe_events;
    return true;
  }
};

LogWriter::LogWriter(const std::filesystem::path& file)
    : implementation_(std::make_unique<Implementation>()) {
  errno = 0;
  implementation_->log.reset(lcm_eventlog_create(file.c_str(), "w"));
  if (!implementation_->log) {
    throw InputError(Problem{
        file.string(), 0, 0,
        std::string("cannot be written: ") + std::strerror(errno) + "; does its folder exist?"});
  }
}

LogWriter::~LogWriter() = default;
LogWriter::LogWriter(LogWriter&&) noexcept = default;
LogWriter& LogWriter::operator=(LogWriter&&) noexcept = default;

bool LogWriter::append(const std::string& channel, std::span<const std::uint8_t> bytes,
                       std::int64_t time_us) {
  if (!implementation_->log || implementation_->refused) return false;
  // liblcm takes mutable pointers for what it only reads.
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

bool LogWriter::close() {
  const bool flushed = flush();
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
               std::size_t frames_per_block) {
  LogWriter writer(file);
  const auto require = [&](bool written) {
    if (!written) {
      throw InputError(
          Problem{file.string(), 0, 0, std::string("cannot be written: ") + std::strerror(errno)});
    }
  };
  recording_info_t info;
  info.schema = 1;
  info.started_utc_us = recording.description.started_utc_us;
  info.rig = recording.description.rig;
  info.program = recording.description.program;
  info.version = recording.description.version;
  info.configuration = recording.description.configuration;
  info.model = recording.description.model;
  info.frames = static_cast<std::int64_t>(recording.frames.size());
  const auto time_us = [](const Frame& frame) { return frame.time_ns / 1000; };
  require(writer.append(recording_channel, encoded(info),
                        recording.frames.empty() ? 0 : time_us(recording.frames.front())));
  frame_block_t block;
  const std::span<const Frame> frames(recording.frames);
  for (std::size_t first = 0; first < frames.size(); first += frames_per_block) {
    const auto some = frames.subspan(first, std::min(frames_per_block, frames.size() - first));
    to_block(some, block);
    require(writer.append(frames_channel, encoded(block), time_us(some.back())));
  }
  require(writer.close());
}

}  // namespace stickslip::protocol
