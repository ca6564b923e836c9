// Losses as events: one when frames begin to be lost, one when that has ended, however many are
// lost in between.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "daemon/event.h"
#include "daemon/ledger.h"

namespace stickslip::daemon {

class LossWatch {
 public:
  /// Compares the books with those of the last look, usually a second ago: what has begun since,
  /// and what has ended. Losses to the shutdown are none that anyone could do something about.
  std::vector<Event> look(const Balance& balance);

 private:
  struct Seen {
    std::uint64_t lost = 0;      ///< at the last look
    std::uint64_t at_begin = 0;  ///< before the losses that go on now
    bool losing = false;
  };
  using Losses = std::array<Seen, loss_count>;

  static void look(const AccountBalance& account, const char* consumer, Losses& losses,
                   std::vector<Event>& events);

  Losses published_{};
  Losses recorded_{};
};

}  // namespace stickslip::daemon
