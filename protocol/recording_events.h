// SPDX-License-Identifier: Apache-2.0
// Reading of the events of an LCM event log, which may be damaged.
#pragma once

#include <cstdint>
#include <istream>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/progress_callback.h"

namespace stickslip::protocol {

/// The first four bytes of every event of a log.
inline constexpr std::string_view sync_word = "\xED\xA1\xDA\x01";

/// True if a file with this beginning is an LCM event log.
bool is_log(std::string_view head);

/// An event on disk: sync word, event number, time, two lengths, channel, data; big-endian.
inline constexpr std::int64_t event_header_bytes = 28;

struct LogEvent {
  std::int64_t number = 0;   ///< in the file, from 0
  std::int64_t time_us = 0;  ///< for log players; the time of a frame is in its message
  std::string channel;
  std::vector<std::uint8_t> data;
  std::int64_t at = 0;   ///< position of its first byte
  std::int64_t end = 0;  ///< position after its last byte
  /// True if another event or the end of the file follows; if not, the next event or the lengths of
  /// this one are damaged.
  bool followed = true;
};

/// Reads the events of a log and resynchronises after damage. Every byte is read a bounded
/// number of times, whatever the content.
///
/// liblcm's own reader is not used: it silently skips damaged data, prints to the terminal, and
/// crashes on a length of 2^31 - 1.
class EventReader {
 public:
  enum class Found : std::uint8_t {
    event,    ///< a complete one, whose data are not checked
    damage,   ///< bytes outside of events
    cut_off,  ///< the beginning of an event, or zeros, at the end of the file
    end,      ///< end of the file
  };

  /// `in` must be seekable and outlive the reader. Messages name it as `name`. Throws
  /// InputError, here and in `next`, if it cannot be read.
  EventReader(std::istream& in, std::string name, ProgressCallback done = {});

  /// Reads the next item: an event, or other bytes, for which only `at` and `end` are set.
  Found next(LogEvent& event);

  /// Description of the latest damage: "no event begins here, ...".
  const std::string& why() const { return why_; }

  /// Rejects the latest event: the next call searches for events within it and returns the bytes
  /// before them as damage.
  void reject(const LogEvent& event);

  std::int64_t size() const { return size_; }

 private:
  struct Header;
  bool read(std::int64_t at, char* into, std::int64_t bytes);
  void read_through(std::int64_t at, char* into, std::int64_t bytes);
  bool read_header(std::int64_t at, Header& header);
  bool is_event(std::int64_t at, const Header& header) const;
  bool looks_like_an_event(std::int64_t at);
  bool is_followed(std::int64_t end);
  bool is_start_of_event(std::int64_t at);
  bool is_zero_from(std::int64_t at);
  std::int64_t find_event(std::int64_t from);
  void read_event(const Header& header, LogEvent& event);

  std::istream& in_;
  std::string name_;
  ProgressCallback done_;
  std::int64_t size_ = 0;
  std::int64_t at_ = 0;
  std::vector<char> window_;  // latest data: a stream drops its buffer at every seek
  std::int64_t window_at_ = 0;
  bool rejected_ = false;
  std::int64_t read_again_ = 0;  // bytes of rejected events
  std::string why_;
};

}  // namespace stickslip::protocol
