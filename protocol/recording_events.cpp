// SPDX-License-Identifier: Apache-2.0
#include "protocol/recording_events.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <span>
#include <string_view>
#include <utility>

#include "physics/problem.h"

namespace stickslip::protocol {

bool is_log(std::string_view head) { return head.substr(0, 4) == sync_word; }
namespace {

// Longest channel name that liblcm's own reader accepts.
constexpr std::int64_t longest_channel = 999;

constexpr std::int64_t window_bytes = 1 << 18;

std::uint64_t big_endian(std::span<const char> bytes) {
  std::uint64_t value = 0;
  for (const char byte : bytes) value = value << 8U | static_cast<std::uint8_t>(byte);
  return value;
}

}  // namespace

struct EventReader::Header {
  std::array<char, event_header_bytes> bytes{};
  bool synchronous = false;
  std::int64_t number = 0;
  std::int64_t time_us = 0;
  std::int64_t channel_size = 0;
  std::int64_t data_size = 0;

  std::int64_t size() const { return event_header_bytes + channel_size + data_size; }
  bool sane() const {
    return channel_size >= 1 && channel_size <= longest_channel && data_size >= 0;
  }
};

EventReader::EventReader(std::istream& in, std::string name, ProgressCallback done)
    : in_(in), name_(std::move(name)), done_(std::move(done)) {
  in_.clear();
  in_.seekg(0, std::ios::end);
  size_ = in_.tellg();
  if (size_ < 0) {
    throw InputError(Problem{name_, 0, 0, "is not a seekable file"});
  }
}

// False if the file has fewer bytes.
bool EventReader::read(std::int64_t at, char* into, std::int64_t bytes) {
  if (bytes > size_ - at) return false;
  if (bytes > window_bytes) {
    read_through(at, into, bytes);
    return true;
  }
  const auto held = static_cast<std::int64_t>(window_.size());
  if (at < window_at_ || at + bytes > window_at_ + held) {
    window_.resize(static_cast<std::size_t>(std::min(window_bytes, size_ - at)));
    window_at_ = at;
    read_through(at, window_.data(), static_cast<std::int64_t>(window_.size()));
  }
  std::copy_n(window_.begin() + (at - window_at_), bytes, into);
  return true;
}

void EventReader::read_through(std::int64_t at, char* into, std::int64_t bytes) {
  in_.seekg(at);
  in_.read(into, bytes);
  if (!in_) {
    throw InputError(
        Problem{name_, 0, 0,
                "at byte " + std::to_string(at) + ": cannot be read: " + std::strerror(errno)});
  }
}

bool EventReader::read_header(std::int64_t at, Header& header) {
  if (!read(at, header.bytes.data(), event_header_bytes)) return false;
  const std::span<const char> bytes(header.bytes);
  header.synchronous = is_log({header.bytes.data(), header.bytes.size()});
  header.number = static_cast<std::int64_t>(big_endian(bytes.subspan<4, 8>()));
  header.time_us = static_cast<std::int64_t>(big_endian(bytes.subspan<12, 8>()));
  header.channel_size = static_cast<std::int32_t>(big_endian(bytes.subspan<20, 4>()));
  header.data_size = static_cast<std::int32_t>(big_endian(bytes.subspan<24, 4>()));
  return true;
}

bool EventReader::is_event(std::int64_t at, const Header& header) const {
  return header.synchronous && header.sane() && header.size() <= size_ - at;
}

// Stricter than where an event is expected, since the sync word can occur by chance.
bool EventReader::looks_like_an_event(std::int64_t at) {
  Header header;
  if (!read_header(at, header) || !is_event(at, header) || header.number < 0) return false;
  std::string channel(static_cast<std::size_t>(header.channel_size), '\0');
  if (!read(at + event_header_bytes, channel.data(), header.channel_size)) return false;
  return std::all_of(channel.begin(), channel.end(), [](char c) { return c > 0x20 && c < 0x7F; });
}

bool EventReader::is_followed(std::int64_t end) {
  std::array<char, 4> next{};
  const std::int64_t there = std::min<std::int64_t>(4, size_ - end);
  if (!read(end, next.data(), there)) return false;
  const std::string_view prefix(next.data(), static_cast<std::size_t>(there));
  return sync_word.starts_with(prefix) || is_zero_from(end);
}

bool EventReader::is_zero_from(std::int64_t at) {
  std::array<char, 1U << 16U> chunk{};
  for (; at < size_; at += static_cast<std::int64_t>(chunk.size())) {
    const std::int64_t bytes =
        std::min<std::int64_t>(static_cast<std::int64_t>(chunk.size()), size_ - at);
    read(at, chunk.data(), bytes);
    if (std::any_of(chunk.begin(), chunk.begin() + bytes, [](char c) { return c != 0; })) {
      return false;
    }
  }
  return true;
}

// True if these bytes are the beginning of an event whose rest is missing. After a power cut some
// file systems leave zeros for data that were not written.
bool EventReader::is_start_of_event(std::int64_t at) {
  std::array<char, 4> sync{};
  const std::int64_t there = std::min<std::int64_t>(4, size_ - at);
  read(at, sync.data(), there);
  const std::string_view prefix(sync.data(), static_cast<std::size_t>(there));
  if (!sync_word.starts_with(prefix)) return is_zero_from(at);
  Header header;
  return !read_header(at, header) || header.sane();
}

// Position of the next event, or of the end of the file.
std::int64_t EventReader::find_event(std::int64_t from) {
  std::array<char, 1U << 16U> chunk{};
  while (from + event_header_bytes <= size_) {
    const std::int64_t bytes =
        std::min<std::int64_t>(static_cast<std::int64_t>(chunk.size()), size_ - from);
    read(from, chunk.data(), bytes);
    const std::string_view text(chunk.data(), static_cast<std::size_t>(bytes));
    for (std::size_t at = text.find(sync_word); at != std::string_view::npos;
         at = text.find(sync_word, at + 1)) {
      const std::int64_t place = from + static_cast<std::int64_t>(at);
      if (looks_like_an_event(place)) return place;
    }
    if (bytes < static_cast<std::int64_t>(chunk.size())) break;
    from += bytes - static_cast<std::int64_t>(sync_word.size()) + 1;
  }
  return size_;
}

void EventReader::read_event(const Header& header, LogEvent& event) {
  event.number = header.number;
  event.time_us = header.time_us;
  event.channel.resize(static_cast<std::size_t>(header.channel_size));
  event.data.resize(static_cast<std::size_t>(header.data_size));
  event.at = at_;
  event.end = at_ + header.size();
  read(at_ + event_header_bytes, event.channel.data(), header.channel_size);
  read(at_ + event_header_bytes + header.channel_size, reinterpret_cast<char*>(event.data.data()),
       header.data_size);
  event.followed = is_followed(event.end);
}

EventReader::Found EventReader::next(LogEvent& event) {
  if (at_ >= size_) return Found::end;
  if (done_) done_(static_cast<double>(at_) / static_cast<double>(size_));
  Header header;
  const bool whole = read_header(at_, header);
  if (!rejected_ && whole && is_event(at_, header)) {
    read_event(header, event);
    at_ = event.end;
    return Found::event;
  }
  const std::int64_t begin = at_;
  const std::int64_t found = find_event(begin + 1);
  const bool cut_off = !rejected_ && found == size_ && is_start_of_event(begin);
  if (rejected_) {
    why_ = "an event with invalid data, not followed by another";
  } else if (whole && header.synchronous && !header.sane()) {
    why_ = "an event with a channel name of " + std::to_string(header.channel_size) +
           " bytes and " + std::to_string(header.data_size) + " bytes of data";
  } else if (whole && header.synchronous) {
    why_ =
        "an event of " + std::to_string(header.size()) + " bytes, more than the rest of the file";
  } else {
    why_ = "no event begins here, where the previous one ends";
  }
  rejected_ = false;
  event.at = begin;
  event.end = at_ = found;
  return cut_off ? Found::cut_off : Found::damage;
}

void EventReader::reject(const LogEvent& event) {
  // Otherwise nested lengths could cause repeated reading of the same data.
  read_again_ += event.end - event.at;
  if (read_again_ > 4 * size_) return;
  at_ = event.at;
  rejected_ = true;
}

}  // namespace stickslip::protocol
