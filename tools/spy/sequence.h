// What the sequence numbers of a stream say about its losses.
#pragma once

#include <cstdint>

namespace stickslip::spy {

/// Counts frames and what is missing between them. A number that does not increase is a source that
/// began anew, or a second one; it is counted, and no loss.
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
