// SPDX-License-Identifier: Apache-2.0
#include "daemon/timing.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace stickslip::daemon {
namespace {

// Bins 0..3 hold 0..3 ns; from there bin 4 (e - 1) + m holds [2^e (1 + m/4), 2^e (1 + (m+1)/4)).
std::size_t bin_of(std::uint64_t ns) {
  if (ns < 4) return ns;
  const auto exponent = static_cast<std::size_t>(std::bit_width(ns) - 1);
  return 4 * (exponent - 1) + ((ns >> (exponent - 2)) & 3U);
}

}  // namespace

std::int64_t DurationHistogram::upper_edge_ns(std::size_t bin) {
  if (bin < 4) return static_cast<std::int64_t>(bin);
  const std::size_t exponent = bin / 4 + 1;
  const std::uint64_t quarter = std::uint64_t{1} << (exponent - 2);
  return static_cast<std::int64_t>((4 + bin % 4 + 1) * quarter - 1);
}

void DurationHistogram::add(std::int64_t duration_ns) {
  const auto ns = static_cast<std::uint64_t>(std::max<std::int64_t>(0, duration_ns));
  count_up(bins_[std::min(bin_of(ns), bin_count - 1)]);
  count_up(count_);
  count_up(total_ns_, ns);
  if (duration_ns > longest_ns()) longest_ns_.store(duration_ns, std::memory_order_relaxed);
}

std::int64_t DurationHistogram::mean_ns() const {
  const std::uint64_t counted = count();
  if (counted == 0) return 0;
  return static_cast<std::int64_t>(total_ns_.load(std::memory_order_relaxed) / counted);
}

std::int64_t DurationHistogram::quantile_ns(double q) const {
  const std::uint64_t total = count();
  if (total == 0) return 0;
  const auto rank =
      static_cast<std::uint64_t>(std::ceil(std::clamp(q, 0.0, 1.0) * static_cast<double>(total)));
  std::uint64_t seen = 0;
  for (std::size_t bin = 0; bin < bin_count; ++bin) {
    seen += bins_[bin].load(std::memory_order_relaxed);
    if (seen >= std::max<std::uint64_t>(1, rank)) return std::min(upper_edge_ns(bin), longest_ns());
  }
  return longest_ns();
}

}  // namespace stickslip::daemon
