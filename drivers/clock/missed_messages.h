// SPDX-License-Identifier: Apache-2.0
// Count of the missed messages of a device that transmits periodically, by itself.
#pragma once

#include <cstdint>

namespace stickslip::drivers {

/// The interval between messages is estimated from those that arrive.
class MissedMessages {
 public:
  /// `nominal_ns`: initial interval; the estimate stays between half and twice of it. `begin_ns`:
  /// start of reception.
  explicit MissedMessages(std::int64_t nominal_ns = 100'000'000, std::int64_t begin_ns = 0)
      : nominal_ns_(static_cast<double>(nominal_ns)),
        last_ns_(static_cast<double>(begin_ns)),
        interval_ns_(nominal_ns_) {}

  /// Number of messages that were missed and not counted before, given that `messages` more, valid
  /// or not, arrived by `time_ns`. A message is missed once it is late by three quarters of the
  /// interval.
  std::uint64_t count(std::int64_t time_ns, std::uint64_t messages);

 private:
  double nominal_ns_;
  double last_ns_;  // actual or expected arrival of the latest message
  double interval_ns_;
};

}  // namespace stickslip::drivers
