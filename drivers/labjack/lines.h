// SPDX-License-Identifier: Apache-2.0
// The digital lines of a LabJack board, as last reported.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>

namespace stickslip::drivers::labjack {

/// Older levels are unknown: a wire that may have been cut counts as cut.
inline constexpr std::int64_t line_validity_ns = 100'000'000;

/// For any thread. One thread writes at a time.
class Lines {
 public:
  /// `requested_ns`: send time of the command with this reply; the levels are not older.
  void update(std::uint32_t levels, std::int64_t requested_ns) {
    levels_.store(levels, std::memory_order_relaxed);
    requested_ns_.store(requested_ns, std::memory_order_release);
  }
  /// To be read before the levels, which are then not older than this.
  std::int64_t requested_ns() const { return requested_ns_.load(std::memory_order_acquire); }
  std::uint32_t levels() const { return levels_.load(std::memory_order_relaxed); }

  /// True if the line is configured, and low or unknown.
  bool low(const std::optional<int>& line, std::int64_t now_ns) const {
    if (!line) return false;
    const bool stale = now_ns - requested_ns() > line_validity_ns;
    return stale || ((levels() >> static_cast<unsigned>(*line)) & 1U) == 0;
  }

 private:
  std::atomic<std::uint32_t> levels_{0};
  std::atomic<std::int64_t> requested_ns_{0};
};

}  // namespace stickslip::drivers::labjack
