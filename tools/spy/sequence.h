// SPDX-License-Identifier: Apache-2.0
// Losses of a stream from its sequence numbers.
#pragma once

#include <cstdint>

namespace stickslip::spy {

/// Counts frames and gaps. A number that does not increase indicates a restarted or a second
/// source; it is counted as a restart, not as a loss.
struct Sequence {
  std::uint64_t frames = 0;
  std::uint64_t gaps = 0;      ///< jumps
  std::uint64_t lost = 0;      ///< frames missing in them
  std::uint64_t restarts = 0;  ///< numbers that did not increase

  void add(std::uint64_t number) {
    if (frames > 0 && number <= last_) {
      ++restarts;
    } else if (frames > 0 && number > last_ + 1) {
      ++gaps;
      lost += number - last_ - 1;
    }
    ++frames;
    last_ = number;
  }

 private:
  std::uint64_t last_ = 0;
};

}  // namespace stickslip::spy
