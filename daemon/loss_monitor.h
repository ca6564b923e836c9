// SPDX-License-Identifier: Apache-2.0
// Losses as events: one when frames begin to be lost, one when that has ended.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "daemon/event.h"
#include "daemon/ledger.h"

namespace stickslip::daemon {

class LossMonitor {
 public:
  /// Compares the ledger with that of the previous call, usually a second ago. Losses to the
  /// shutdown are not reported.
  std::vector<Event> update(const Balance& balance);

 private:
  struct Episode {
    std::uint64_t lost = 0;      ///< at the previous call
    std::uint64_t at_begin = 0;  ///< before the losses that continue now
    bool losing = false;
  };
  using Episodes = std::array<Episode, loss_count>;
  struct Consumer {
    const char* name;
    Severity severity;  ///< of its losses
  };

  static void update(const AccountBalance& account, const Consumer& consumer, Episodes& episodes,
                     std::vector<Event>& events);

  Episodes published_{};
  Episodes recorded_{};
};

}  // namespace stickslip::daemon
