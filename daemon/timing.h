// SPDX-License-Identifier: Apache-2.0
// Timing statistics of the loop: written by the loop, read by any thread.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace stickslip::daemon {

/// Adds to a counter with one writer: a plain load and store, cheaper than an atomic addition.
inline void count_up(std::atomic<std::uint64_t>& counter, std::uint64_t by = 1) {
  counter.store(counter.load(std::memory_order_relaxed) + by, std::memory_order_relaxed);
}

/// Histogram of durations in logarithmic bins, four to the octave: quantiles are accurate to 19 %.
/// One writer, any number of readers; neither waits.
class DurationHistogram {
 public:
  /// Negative durations count as 0.
  void add(std::int64_t duration_ns);

  std::uint64_t count() const { return count_.load(std::memory_order_relaxed); }
  std::int64_t longest_ns() const { return longest_ns_.load(std::memory_order_relaxed); }
  std::uint64_t total_ns() const { return total_ns_.load(std::memory_order_relaxed); }
  /// 0 if empty.
  std::int64_t mean_ns() const;

  static constexpr std::size_t bin_count = 160;
  std::uint64_t count_in(std::size_t bin) const {
    return bins_[bin].load(std::memory_order_relaxed);
  }
  /// The longest duration that a bin counts.
  static std::int64_t upper_edge_ns(std::size_t bin);

  /// Upper edge of the bin that holds the quantile `q` in [0, 1], at most the longest duration;
  /// 0 if empty.
  std::int64_t quantile_ns(double q) const;

 private:
  std::array<std::atomic<std::uint64_t>, bin_count> bins_{};
  std::atomic<std::uint64_t> count_{0};
  std::atomic<std::uint64_t> total_ns_{0};
  std::atomic<std::int64_t> longest_ns_{0};
};

/// Single writer: the loop.
struct Timing {
  DurationHistogram lateness;  ///< of the wake-up against its deadline
  DurationHistogram work;      ///< of a cycle, from wake-up to the last hand-over
  DurationHistogram read;      ///< of a read of the device
  std::atomic<std::uint64_t> cycles{0};
  std::atomic<std::uint64_t> late{0};             ///< cycles beyond the limit of lateness
  std::atomic<std::uint64_t> overruns{0};         ///< cycles that ended after the next deadline
  std::atomic<std::uint64_t> skipped_periods{0};  ///< periods without a cycle, from overruns
  std::atomic<std::int64_t> longest_overrun_ns{0};
  std::atomic<std::uint64_t> failed_reads{0};  ///< temporary failures and faults
  std::atomic<std::uint64_t> failed_writes{0};
  std::atomic<std::uint64_t> missing_at_source{0};  ///< frames, by jumps of the sequence number
  std::atomic<std::uint64_t> repeated{0};           ///< frames that had been handed over before
  std::atomic<std::uint64_t> not_finite{0};         ///< readings that were NaN or infinite
  std::atomic<std::uint64_t> lost_events{0};        ///< notices that found their ring full
};

}  // namespace stickslip::daemon
