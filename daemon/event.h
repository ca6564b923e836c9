// SPDX-License-Identifier: Apache-2.0
// Events: notices of the loop and other occurrences, in words for people and codes for programs.
#pragma once

#include <cstdint>
#include <string>

#include "daemon/sample.h"

namespace stickslip::daemon {

enum class Severity : std::uint8_t { info, warning, error };

struct Event {
  Severity severity = Severity::info;
  std::string code;            ///< identifier for programs: "overrun"
  std::string message;         ///< one sentence
  std::int64_t time_ns = 0;    ///< rig time of the latest frame before it
  std::uint64_t sequence = 0;  ///< of that frame
  std::string subject = {};    ///< channel or consumer, for codes that concern several
};

Event event_of(const Notice& notice);

/// An operator's note about the rig after a frame. Throws InputError for an empty text, one of more
/// than 500 bytes, and control characters.
Event note_event(const std::string& text, std::int64_t time_ns, std::uint64_t sequence);

/// Summary of several notices of one kind: `sum` is the latest, with the sum of their counts and
/// their longest duration.
Event event_of(const Notice& sum, std::uint64_t notices);

}  // namespace stickslip::daemon
