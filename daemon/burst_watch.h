// What a bad minute of a device or a machine says a hundred times a second, told once a second: the
// first at once, as what it is, and what followed it within a second as one event with a count.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "daemon/event.h"
#include "daemon/sample.h"

namespace stickslip::daemon {

/// Pure: times [ns], which must not go back, are the caller's.
class BurstWatch {
 public:
  /// What to say of a notice now; nothing where it is held back for `due`. Gaps of the sequence
  /// number, repeated numbers, overruns and restarts of the observer are held back; all others
  /// never are.
  std::optional<Event> take(const Notice& notice, std::int64_t now_ns);

  /// What has been held back for a second. To be asked more often than that.
  std::vector<Event> due(std::int64_t now_ns);

  /// What is still held back, at the end.
  std::vector<Event> rest();

 private:
  struct Burst {
    std::optional<std::int64_t> reported_ns = {};  ///< when something last was
    std::uint64_t notices = 0;                     ///< held back since
    std::uint64_t count = 0;                       ///< sum of theirs
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
