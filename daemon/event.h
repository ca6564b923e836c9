// What the loop noticed, as a person reads it.
#pragma once

#include <cstdint>
#include <string>

#include "daemon/sample.h"

namespace stickslip::daemon {

enum class Severity : std::uint8_t { info, warning, error };

struct Event {
  Severity severity = Severity::info;
  std::string code;            ///< one word that programs can look for: "overrun"
  std::string message;         ///< one sentence
  std::int64_t time_ns = 0;    ///< rig time of the latest frame before it
  std::uint64_t sequence = 0;  ///< of that frame
};

/// The notice in words.
Event event_of(const Notice& notice);

/// A model_broken with the times that a person and a diagnosis need: the time of day (UTC) since
/// when it is so, and the stretch of the recording. `utc_us`: now.
Event with_times(Event event, const ModelVerdict& verdict, std::int64_t utc_us);

/// Several of a kind in words, told as of the latest: `sum` holds their counts together and the
/// longest duration. For gaps and repetitions of the sequence number, overruns, and restarts
/// of the observer.
Event event_of(const Notice& sum, std::uint64_t notices);

}  // namespace stickslip::daemon
