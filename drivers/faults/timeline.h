// SPDX-License-Identifier: Apache-2.0
// Times at which a fault of a script is active.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

#include "config/fault_script.h"
#include "drivers/faults/chance.h"

namespace stickslip::drivers {

/// Half-open interval of script time [ns].
struct Occurrence {
  std::uint64_t number = 0;  ///< 0 for the first, then counted up by every_s
  std::int64_t begin_ns = 0;
  std::int64_t end_ns = std::numeric_limits<std::int64_t>::max();  ///< default: the end of the run
};

/// The occurrences of one fault, which do not overlap. Owns no heap memory and has no state: the
/// result depends only on the time.
class Timeline {
 public:
  /// `fault` must be valid, as load_fault_script ensures.
  Timeline(const config::Fault& fault, Chance chance);

  /// The occurrence that is active at a time.
  std::optional<Occurrence> at(std::int64_t time_ns) const;

 private:
  Chance chance_;
  std::int64_t from_ns_;
  std::int64_t width_ns_;     // of the interval in which it begins
  std::int64_t duration_ns_;  // 0: to the end
  std::int64_t every_ns_;     // 0: once
};

}  // namespace stickslip::drivers
