// SPDX-License-Identifier: Apache-2.0
// Limits the rate of events and log lines that a failing device, an overloaded machine or a client
// causes hundreds of times a second: the first is reported immediately, those that follow as
// summaries with their count, after one second and then at intervals that double to a minute. A
// burst is over after ten seconds without; what is held back then is its last line.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "daemon/event.h"
#include "daemon/sample.h"

namespace stickslip::daemon {

/// Reports of single events before summaries.
struct Allowance {
  double reports = 1.0;     ///< in immediate succession
  double per_second = 0.0;  ///< rate at which they are regained; otherwise at the end of a burst
};

/// Pure: the caller supplies the times [ns], which must not decrease. Events of one code and
/// subject are one burst.
class EventThrottle {
 public:
  /// The event to report now; nullopt if it is held back for a summary. Changes of state, faults
  /// and verdicts are never held back.
  std::optional<Event> accept(const Notice& notice, std::int64_t now_ns);
  std::optional<Event> accept(const Event& event, std::int64_t now_ns, const Allowance& allowance);

  /// Summaries that are due. To be called several times a second.
  std::vector<Event> due(std::int64_t now_ns);

  /// Summaries of what is still held back.
  std::vector<Event> flush();

 private:
  struct Burst {
    double credit = 0.0;
    std::int64_t latest_ns = 0;
    std::int64_t reported_ns = 0;
    std::int64_t interval_ns = 0;
    std::uint64_t held = 0;          ///< since the latest report
    Event latest = {};               ///< of those
    std::optional<Notice> sum = {};  ///< of those: the latest, with the sum of the counts and the
                                     ///< longest duration; nothing for other events
  };

  /// The burst to which it is added; null if it is to be reported now.
  Burst* hold(const Event& event, std::int64_t now_ns, const Allowance& allowance);
  static Event summary(const Burst& burst);

  std::map<std::string, Burst> bursts_;  // by code and subject
};

}  // namespace stickslip::daemon
