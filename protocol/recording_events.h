// The events of an LCM event log, one after the other, whatever became of the file.
#pragma once

#include <cstdint>
#include <istream>
#include <string>
#include <vector>

#include "protocol/share_done.h"

namespace stickslip::protocol {

/// An event on disk: sync word, event number, time, two lengths, channel, data; big-endian.
inline constexpr std::int64_t event_header_bytes = 28;

struct LogEvent {
  std::int64_t number = 0;   ///< as the file says, from 0
  std::int64_t time_us = 0;  ///< for players; what counts is the time within a message
  std::string channel;
  std::vector<std::uint8_t> data;
  std::int64_t at = 0;   ///< its first byte in the file
  std::int64_t end = 0;  ///< the byte behind it
  /// Whether the file goes on behind it as behind an event: another one, or the end. If not, either
  /// the next one is damaged or this one's lengths are.
  bool followed = true;
};

/// Walks over the bytes of a log. Finds its way again behind what is damaged; reads a file from
/// front to back a small number of times at most, whatever is in it.
///
/// liblcm's own reader is not used: it skips what it does not understand without a word, prints
/// some of it, and a length of 2^31 - 1 crashes it.
class EventReader {
 public:
  enum class Found : std::uint8_t {
    event,    ///< a whole one; that its data are sound is for others to say
    damage,   ///< bytes that are no event, with an event behind them, or strange ones at the end
    cut_off,  ///< the beginning of an event, or zeros, and nothing behind: the file was cut off
              ///< there
    end,      ///< nothing is left
  };

  /// A stream that can seek; it must outlive the reader. `name` stands for it in messages. Throws
  /// InputError, here and in `next`, where it cannot be read.
  EventReader(std::istream& in, std::string name, ShareDone done = {});

  /// Goes on. What was found: an event, or (with `at`, `end` alone) the bytes that are none.
  Found next(LogEvent& event);

  /// Of the damage found last, for a person: "no event begins here, ...".
  const std::string& why() const { return why_; }

  /// The event found last is not believed: what looks like one within it is looked for instead, and
  /// the bytes before that are damage, which the next call finds.
  void distrust(const LogEvent& event);

  std::int64_t size() const { return size_; }

 private:
  struct Header;
  bool read(std::int64_t at, char* into, std::int64_t bytes);
  void read_through(std::int64_t at, char* into, std::int64_t bytes);
  bool read_header(std::int64_t at, Header& header);
  bool is_event(std::int64_t at, const Header& header) const;
  bool looks_like_an_event(std::int64_t at);
  bool is_followed(std::int64_t end);
  bool is_begun(std::int64_t at);
  bool is_zero_from(std::int64_t at);
  std::int64_t find_event(std::int64_t from);
  void read_event(const Header& header, LogEvent& event);

  std::istream& in_;
  std::string name_;
  ShareDone done_;
  std::int64_t size_ = 0;
  std::int64_t at_ = 0;
  std::vector<char> window_;  // what was read last: a stream forgets its buffer at every seek
  std::int64_t window_at_ = 0;
  bool distrusted_ = false;
  std::int64_t read_again_ = 0;  // bytes that were part of events not believed
  std::string why_;
};

}  // namespace stickslip::protocol
