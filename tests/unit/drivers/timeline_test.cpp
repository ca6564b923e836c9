// SPDX-License-Identifier: Apache-2.0
#include "drivers/faults/timeline.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <cstdlib>
#include <set>

namespace stickslip::drivers {
namespace {

/// The same cases in every run, unless others are requested.
const int seeded = setenv("RC_PARAMS", "seed=20260102 max_success=200", 0);

constexpr std::int64_t second_ns = 1'000'000'000;

config::Fault from_to(double from_s, double to_s) {
  config::Fault fault;
  fault.from_s = from_s;
  fault.to_s = to_s;
  return fault;
}

TEST(Timeline, IsActiveFromBeginToEnd) {
  config::Fault fault = from_to(2.0, 2.0);
  const Timeline for_ever(fault, Chance(1, 0));
  EXPECT_FALSE(for_ever.at(-second_ns));
  EXPECT_FALSE(for_ever.at(2 * second_ns - 1));
  ASSERT_TRUE(for_ever.at(2 * second_ns));
  EXPECT_EQ(for_ever.at(2 * second_ns)->begin_ns, 2 * second_ns);
  EXPECT_TRUE(for_ever.at(1000000 * second_ns));
  fault.duration_s = 0.5;
  const Timeline once(fault, Chance(1, 0));
  EXPECT_TRUE(once.at(2'499'999'999));
  EXPECT_FALSE(once.at(2'500'000'000));
  EXPECT_FALSE(once.at(12'100'000'000));
  fault.every_s = 10.0;
  const Timeline again(fault, Chance(1, 0));
  EXPECT_FALSE(again.at(2'500'000'000));
  ASSERT_TRUE(again.at(32'100'000'000));
  EXPECT_EQ(again.at(32'100'000'000)->number, 3U);
  EXPECT_EQ(again.at(32'100'000'000)->begin_ns, 32 * second_ns);
  EXPECT_EQ(again.at(32'100'000'000)->end_ns, 32'500'000'000);
}

TEST(Timeline, LastsAtLeastANanosecond) {
  config::Fault fault = from_to(1.0, 1.0);
  fault.duration_s = 1.0e-12;
  const Timeline timeline(fault, Chance(1, 0));
  EXPECT_TRUE(timeline.at(second_ns));
  EXPECT_FALSE(timeline.at(second_ns + 1));
}

/// The occurrence of a number, found by search.
std::optional<Occurrence> found(const Timeline& timeline, std::int64_t from_ns,
                                std::int64_t to_ns) {
  for (std::int64_t t = from_ns; t < to_ns; t += 1'000'000) {
    if (const auto occurrence = timeline.at(t)) return occurrence;
  }
  return std::nullopt;
}

RC_GTEST_PROP(Timeline, RandomBeginsLieInTheirIntervalIndependently, ()) {
  config::Fault fault = from_to(1.0, 2.0);
  fault.duration_s = 0.5;
  fault.every_s = 1.5;
  const auto seed = *rc::gen::arbitrary<std::uint64_t>();
  const Timeline timeline(fault, Chance(seed, 3));
  std::set<std::int64_t> offsets;
  for (std::int64_t k = 0; k < 8; ++k) {
    const std::int64_t from = second_ns + k * 1'500'000'000;
    const auto occurrence = found(timeline, from, from + 1'500'000'000);
    RC_ASSERT(occurrence.has_value());
    RC_ASSERT(occurrence->number == static_cast<std::uint64_t>(k));
    RC_ASSERT(occurrence->begin_ns >= from);
    RC_ASSERT(occurrence->begin_ns <= from + second_ns);
    RC_ASSERT(occurrence->end_ns == occurrence->begin_ns + 500'000'000);
    offsets.insert(occurrence->begin_ns - from);
    // The same at any time within it.
    const auto late = timeline.at(occurrence->end_ns - 1);
    RC_ASSERT(late && late->begin_ns == occurrence->begin_ns);
  }
  RC_ASSERT(offsets.size() == 8U);
}

TEST(Timeline, BeginDependsOnSeedAndPosition) {
  const config::Fault fault = from_to(1.0, 2.0);
  const auto begin = [&fault](std::uint64_t seed, std::uint64_t position) {
    return Timeline(fault, Chance(seed, position)).at(3 * second_ns)->begin_ns;
  };
  EXPECT_EQ(begin(1, 0), begin(1, 0));
  EXPECT_NE(begin(1, 0), begin(2, 0));
  EXPECT_NE(begin(1, 0), begin(1, 1));
}

TEST(Chance, IsUniformNormalAndStateless) {
  const Chance chance(7, 2);
  constexpr int count = 20000;
  double sum = 0.0;
  double normal_sum = 0.0;
  double normal_squares = 0.0;
  double product = 0.0;
  int hits = 0;
  for (std::uint64_t i = 0; i < count; ++i) {
    const double u = chance.uniform(Purpose::moment, i);
    ASSERT_GE(u, 0.0);
    ASSERT_LT(u, 1.0);
    const double n = chance.normal(i, 1);
    ASSERT_TRUE(std::isfinite(n));
    sum += u;
    normal_sum += n;
    normal_squares += n * n;
    product += n * chance.normal(i, 2);
    if (chance.hits(0.25, i)) ++hits;
    EXPECT_TRUE(chance.hits(1.0, i));
  }
  // Five standard deviations each.
  const double root = std::sqrt(static_cast<double>(count));
  EXPECT_NEAR(sum / count, 0.5, 5.0 * 0.2887 / root);
  EXPECT_NEAR(normal_sum / count, 0.0, 5.0 / root);
  EXPECT_NEAR(normal_squares / count, 1.0, 5.0 * 1.4142 / root);
  EXPECT_NEAR(product / count, 0.0, 5.0 / root) << "channels are independent";
  EXPECT_NEAR(hits, 0.25 * count, 5.0 * std::sqrt(count * 0.25 * 0.75));
}

TEST(Timeline, RandomCasesAreSeeded) { EXPECT_EQ(seeded, 0); }

}  // namespace
}  // namespace stickslip::drivers
