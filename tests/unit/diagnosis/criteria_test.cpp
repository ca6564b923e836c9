// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/criteria.h"

#include <gtest/gtest.h>

#include <cmath>
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

TEST(Criteria, OfAClaimFollowTheRateOfFalseAlarms) {
  Criteria criteria;
  EXPECT_DOUBLE_EQ(criteria.claim_level(), 5.0e-4);
  EXPECT_NEAR(std::exp(criteria.claim_nats()), 2000.0, 1.0e-6);
  criteria.false_alarm_rate = 1.0e-4;
  EXPECT_DOUBLE_EQ(criteria.claim_level(), 5.0e-6);
  criteria.false_alarm_rate = 0.0;
  EXPECT_EQ(invalid(criteria), "false_alarm_rate is 0; expected 1e-09 to 1");
}

}  // namespace
}  // namespace stickslip::diagnosis
