// SPDX-License-Identifier: Apache-2.0
#include "daemon/command.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace stickslip::daemon {
namespace {

TEST(Averaging, GivesMeanAndDeviationOfValidReadings) {
  Averaging averaging;
  EXPECT_FALSE(averaging.active());
  averaging.begin(4, 17);
  const double values[] = {1e6 + 1.0, 1e6 + 2.0, 1e6 + 3.0, 1e6 + 6.0};
  for (int i = 0; i < 4; ++i) {
    Frame frame;
    frame.set(Channel::friction_force, values[i]);
    if (i % 2 == 0) frame.set(Channel::velocity, 5.0);
    if (i == 1) frame.set(Channel::displacement, std::numeric_limits<double>::quiet_NaN());
    EXPECT_EQ(averaging.add(frame), i == 3);
  }
  EXPECT_EQ(averaging.id(), 17U);
  const Average out = averaging.take();
  EXPECT_FALSE(averaging.active());
  EXPECT_EQ(out.frames, 4U);
  const auto friction = index_of(Channel::friction_force);
  EXPECT_EQ(out.count[friction], 4U);
  EXPECT_DOUBLE_EQ(out.mean[friction], 1e6 + 3.0);
  EXPECT_NEAR(out.deviation[friction], std::sqrt(14.0 / 3.0), 1e-9);
  EXPECT_EQ(out.count[index_of(Channel::velocity)], 2U);
  EXPECT_EQ(out.deviation[index_of(Channel::velocity)], 0.0);
  EXPECT_EQ(out.count[index_of(Channel::displacement)], 0U);
}

TEST(Averaging, CountsCorrelatedReadingsAsFewer) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise;
  Averaging averaging;
  averaging.begin(8000, 1);
  double slow = 0.0;
  for (int i = 0; i < 8000; ++i) {
    if (i % 20 == 0) slow = noise(random);  // each value twenty times
    Frame frame;
    frame.set(Channel::friction_force, slow);
    frame.set(Channel::normal_load, noise(random));
    averaging.add(frame);
  }
  const Average out = averaging.take();
  const double correlated = out.independent[index_of(Channel::friction_force)];
  const double white = out.independent[index_of(Channel::normal_load)];
  EXPECT_GT(correlated, 400.0 / 3.0);  // sixteen batches give a variance to a factor of three
  EXPECT_LT(correlated, 400.0 * 3.0);
  EXPECT_GT(white, 8000.0 / 3.0);
  EXPECT_LE(white, 8000.0);
}

}  // namespace
}  // namespace stickslip::daemon
