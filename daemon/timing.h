// How well the loop keeps time: written by the loop, read by anyone.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace stickslip::daemon {

/// Adds to a counter that has one writer: a plain load and store, cheaper than a locked addition.
inline void count_up(std::atomic<std::uint64_t>& counter, std::uint64_t by = 1) {
  counter.store(counter.load(std::memory_order_relaxed) + by, std::memory_order_relaxed);
}

/// Durations counted in logarithmic bins, four to the octave, so a quantile is known to 19 %. One
/// writer, any number of readers; neither waits.
class DurationHistogram {
 public:
  /// Negative durations count as 0.
  void add(std::int64_t duration_ns);

  std::uint64_t count() const { return count_.load(std::memory_order_relaxed); }
  std::int64_t longest_ns() const { return longest_ns_.load(std::memory_order_relaxed); }
  std::uint64_t total_ns() const { return total_ns_.load(std::memory_order_relaxed); }
  /// 0 where nothing was counted.
  std::int64_t mean_ns() const;

  static constexpr std::size_t bin_count = 160;
  std::uint64_t count_in(std::size_t bin) const {
    return bins_[bin].load(std::memory_order_relaxed);
  }
  /// The longest duration that a bin counts.
  static std::int64_t upper_edge_ns(std::size_t bin);

  /// Upper edge of the bin that holds the quantile `q` in [0, 1], never above the longest seen;
  /// 0 where nothing was counted.
  std::int64_t quantile_ns(double q) const;

 private:
  std::array<std::atomic<std::uint64_t>, bin_count> bins_{};
  std::atomic<std::uint64_t> count_{0};
  std::atomic<std::uint64_t> total_ns_{0};
  std::atomic<std::int64_t> longest_ns_{0};
};

/// What the loop counts about itself. Single writer: the loop.
struct Timing {
  DurationHistogram lateness;  ///< of the wake-up against its deadline
  DurationHistogram work;      ///< of a cycle from wake-up to the last hand-over
  DurationHistogram read;      ///< of the device's answer to a read
  std::atomic<std::uint64_t> cycles{0};
  std::atomic<std::uint64_t> late{0};             ///< cycles out of the limit of lateness
  std::atomic<std::uint64_t> overruns{0};         ///< cycles whose work passed the next deadline
  std::atomic<std::uint64_t> skipped_periods{0};  ///< periods without a cycle, from overruns
  std::atomic<std::int64_t> longest_overrun_ns{0};
  std::atomic<std::uint64_t> failed_reads{0};  ///< temporary failures and faults
  std::atomic<std::uint64_t> failed_writes{0};
  std::atomic<std::uint64_t> missing_at_source{0};  ///< frames by jumps of the sequence number
  std::atomic<std::uint64_t> repeated{0};           ///< frames that had been handed over before
  std::atomic<std::uint64_t> not_finite{0};         ///< channel readings that were NaN or infinite
  std::atomic<std::uint64_t> lost_events{0};        ///< events that found their ring full
};

}  // namespace stickslip::daemon
