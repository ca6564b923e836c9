// SPDX-License-Identifier: Apache-2.0
#include "tools/calibration/significance.h"

#include <gtest/gtest.h>

#include <limits>

namespace stickslip::calibration {
namespace {

// Values of statistical tables.
TEST(Significance, AgreesWithTables) {
  EXPECT_NEAR(chi_squared_beyond(3.841459, 1), 0.05, 1e-7);
  EXPECT_NEAR(chi_squared_beyond(10.827566, 1), 0.001, 1e-8);
  EXPECT_NEAR(chi_squared_beyond(18.307038, 10), 0.05, 1e-7);
  EXPECT_NEAR(chi_squared_beyond(29.588298, 10), 0.001, 1e-8);
  EXPECT_EQ(chi_squared_beyond(0.0, 3), 1.0);
  EXPECT_NEAR(normal_beyond(1.959964), 0.05, 1e-7);
  EXPECT_NEAR(normal_beyond(-3.290527), 0.001, 1e-8);
  EXPECT_NEAR(student_beyond(12.706205, 1), 0.05, 1e-7);
  EXPECT_NEAR(student_beyond(-2.228139, 10), 0.05, 1e-7);
  EXPECT_NEAR(student_beyond(4.586894, 10), 0.001, 1e-8);
  EXPECT_EQ(student_beyond(0.0, 3), 1.0);
  EXPECT_EQ(student_beyond(std::numeric_limits<double>::infinity(), 3), 0.0);
}

TEST(Significance, CoverageIsTheInverse) {
  EXPECT_NEAR(student_coverage_95(1), 12.706205, 1e-5);
  EXPECT_NEAR(student_coverage_95(4), 2.776445, 1e-5);
  EXPECT_NEAR(student_coverage_95(1000), 1.962339, 1e-5);
}

}  // namespace
}  // namespace stickslip::calibration
