// Limits the rate of events that a failing device or an overloaded machine causes hundreds of times
// a second: the first is reported immediately, those that follow within a second as one event with
// a count.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "daemon/event.h"
#include "daemon/sample.h"

namespace stickslip::daemon {

/// Pure: the caller supplies the times [ns], which must not decrease.
class EventThrottle {
 public:
  /// The event to report now; nullopt if it is held back for a summary. Gaps of the sequence
  /// number, repeated numbers, overruns and restarts of the observer are held back, others never.
  std::optional<Event> accept(const Notice& notice, std::int64_t now_ns);

  /// Summaries of what has been held back for a second. To be called more often than that.
  std::vector<Event> due(std::int64_t now_ns);

  /// Summaries of what is still held back.
  std::vector<Event> flush();

 private:
  struct Burst {
    std::optional<std::int64_t> reported_ns = {};  ///< time of the latest report
    std::uint64_t notices = 0;                     ///< held back since
    std::uint64_t count = 0;                       ///< sum of their counts
    std::int64_t longest_ns = 0;                   ///< of their durations
    Notice latest = {};
  };
  static constexpr std::array kinds = {Notice::Kind::frames_missing,
                                       Notice::Kind::sequence_repeated, Notice::Kind::overrun,
                                       Notice::Kind::estimate_restarted};

  static Event summary(const Burst& burst);

  std::array<Burst, kinds.size()> bursts_;
};

}  // namespace stickslip::daemon
