// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/criteria.h"

#include <gtest/gtest.h>

#include <limits>

namespace stickslip::diagnosis {
namespace {

TEST(Criteria, DefaultsAreValid) { EXPECT_EQ(invalid({}), ""); }

TEST(Criteria, NameTheValueOutsideItsRange) {
  Criteria criteria;
  criteria.claim_share_unexplained = 1.5;
  EXPECT_EQ(invalid(criteria), "claim_share_unexplained is 1.5; expected 0 to 1");
  criteria = {};
  criteria.explained_chi2 = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(invalid(criteria), "explained_chi2 is nan; expected 1 or more");
  criteria = {};
  criteria.effort.screening_windows = 1;
  EXPECT_EQ(invalid(criteria), "effort.screening_windows is 1; expected 2 or more");
  criteria = {};
  criteria.effort.rough_iterations = 0;
  EXPECT_EQ(invalid(criteria), "effort.rough_iterations is 0; expected 1 or more");
}

}  // namespace
}  // namespace stickslip::diagnosis
