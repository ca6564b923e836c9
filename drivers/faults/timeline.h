// When a fault of a script lasts, and when it does not.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

#include "config/fault_script.h"
#include "drivers/faults/chance.h"

namespace stickslip::drivers {

/// From its beginning to its end, the end not included [ns of the script].
struct Occurrence {
  std::uint64_t number = 0;  ///< 0 for the first, then counted up by every_s
  std::int64_t begin_ns = 0;
  std::int64_t end_ns = std::numeric_limits<std::int64_t>::max();  ///< the run's, where it is that
};

/// The occurrences of one fault. They do not overlap. Owns no memory and has no state: the same
/// moment gets the same answer, whatever was asked before.
class Timeline {
 public:
  /// `fault` is sound, as load_fault_script leaves it.
  Timeline(const config::Fault& fault, Chance chance);

  /// What lasts at that moment.
  std::optional<Occurrence> at(std::int64_t time_ns) const;

 private:
  Chance chance_;
  std::int64_t from_ns_;
  std::int64_t width_ns_;     // of the span in which it begins
  std::int64_t duration_ns_;  // 0: to the end
  std::int64_t every_ns_;     // 0: once
};

}  // namespace stickslip::drivers
