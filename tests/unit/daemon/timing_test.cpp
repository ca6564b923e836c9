// SPDX-License-Identifier: Apache-2.0
#include "daemon/timing.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace stickslip::daemon {
namespace {

TEST(DurationHistogram, IsInitiallyEmptyAndCountsNegativesAsZero) {
  DurationHistogram histogram;
  EXPECT_EQ(histogram.quantile_ns(0.5), 0);
  histogram.add(-5);
  EXPECT_EQ(histogram.count(), 1U);
  EXPECT_EQ(histogram.quantile_ns(1.0), 0);
}

RC_GTEST_PROP(DurationHistogram, QuantilesExceedTheTrueValueByLessThanAQuarter, ()) {
  auto durations = *rc::gen::nonEmpty(rc::gen::container<std::vector<std::int64_t>>(
      rc::gen::inRange<std::int64_t>(0, 10'000'000'000)));
  DurationHistogram histogram;
  for (const std::int64_t duration : durations) histogram.add(duration);
  std::sort(durations.begin(), durations.end());
  RC_ASSERT(histogram.longest_ns() == durations.back());
  for (const double q : {0.0, 0.5, 0.99, 1.0}) {
    const auto rank = std::max<std::size_t>(
        1, static_cast<std::size_t>(std::ceil(q * static_cast<double>(durations.size()))));
    const std::int64_t exact = durations[rank - 1];
    RC_ASSERT(histogram.quantile_ns(q) >= exact);
    RC_ASSERT(histogram.quantile_ns(q) <= exact + exact / 4);
  }
}

}  // namespace
}  // namespace stickslip::daemon
