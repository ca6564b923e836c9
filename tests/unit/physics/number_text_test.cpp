// SPDX-License-Identifier: Apache-2.0
#include "physics/number_text.h"

#include <gtest/gtest.h>

#include <cmath>

#include "physics/unsigned_zero.h"

namespace stickslip::physics {
namespace {

TEST(NumberText, GivesAZeroNoSign) {
  EXPECT_EQ(number_text(-0.0), "0");
  EXPECT_EQ(shortest_text(-0.0), "0");
  EXPECT_EQ(fixed_text(-0.0004, 3), "0.000");
  EXPECT_EQ(fixed_text(-0.04, 1), "0.0");
  EXPECT_EQ(with_unsigned_zero("-0e+00"), "0e+00");
  EXPECT_FALSE(std::signbit(unsigned_zero(-0.0)));
}

TEST(NumberText, KeepsTheSignOfOtherNumbers) {
  EXPECT_EQ(number_text(-0.01), "-0.01");
  EXPECT_EQ(number_text(-1e-20), "-1e-20");
  EXPECT_EQ(fixed_text(-0.0006, 3), "-0.001");
  EXPECT_EQ(fixed_text(1.25, 1, true), "+1.2");
  EXPECT_EQ(shortest_text(-0.1), "-0.1");
  EXPECT_EQ(shortest_text(-5e-324), "-5e-324");
}

TEST(NumberText, CountsWithANoun) {
  EXPECT_EQ(counted(1, "frame"), "1 frame");
  EXPECT_EQ(counted(0, "frame"), "0 frames");
  EXPECT_EQ(counted(2ULL, "frame"), "2 frames");
  EXPECT_EQ(counted(3, "analysis", "analyses"), "3 analyses");
}

}  // namespace
}  // namespace stickslip::physics
