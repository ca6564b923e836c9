// SPDX-License-Identifier: Apache-2.0
#include "daemon/base_limits.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <vector>

namespace stickslip::daemon {
namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;
constexpr double h = 1e-3;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr MotionLimits usual{0.015, 0.5, 20.0};

/// Feeds the limiter from rest at 0 and checks every output.
class Watched {
 public:
  Watched(const MotionLimits& limits, double period_s)
      : limits_(limits), h_(period_s), stage_(limits, period_s) {}

  double next(double wanted) {
    const double x = stage_.next(wanted);
    const double velocity = (x - x_) / h_;
    const double acceleration = (x - 2.0 * x_ + before_) / (h_ * h_);
    within_limits_ = within_limits_ && std::isfinite(x) && std::abs(x) <= limits_.displacement &&
                     std::abs(velocity) <= limits_.velocity &&
                     std::abs(acceleration) <= limits_.acceleration;
    before_ = x_;
    x_ = x;
    return x;
  }
  bool within_limits() const { return within_limits_; }
  const BaseLimits& stage() const { return stage_; }

 private:
  MotionLimits limits_;
  double h_;
  BaseLimits stage_;
  double x_ = 0.0;
  double before_ = 0.0;
  bool within_limits_ = true;
};

TEST(BrakingStep, IsTheLongestFromWhichBrakingEndsBeforeTheBound) {
  for (const double change : {1.0, 0.37, 1e-5}) {
    for (double distance = 0.0; distance < 60.0 * change; distance += 0.73 * change) {
      const double step = braking_step(distance, change);
      double covered = 0.0;
      for (double s = step; s > 0.0; s -= change) covered += s;
      EXPECT_NEAR(covered, distance, 1e-12 * (distance + change)) << distance << " " << change;
    }
  }
  EXPECT_EQ(braking_step(0.3, std::numeric_limits<double>::infinity()), 0.3);
}

// Steps, noise, signals that are far too large, NaN and infinity.
RC_GTEST_PROP(BaseLimits, HoldForAnySequence, ()) {
  const auto between = [](double low, double high) {
    return std::exp(std::log(low) + std::log(high / low) * 1e-3 * *rc::gen::inRange(0, 1001));
  };
  const double period_s = *rc::gen::element(1e-2, 1e-3, 1e-4, 5e-5);
  const MotionLimits limits{between(1e-4, 0.1), between(0.01, 5.0), between(5.0, 500.0)};
  Watched watched(limits, period_s);
  const auto pieces = *rc::gen::inRange(1, 12);
  for (int piece = 0; piece < pieces; ++piece) {
    const int kind = *rc::gen::inRange(0, 7);
    const int length = *rc::gen::inRange(1, 400);
    const double level = limits.displacement * 0.01 * *rc::gen::inRange(-300, 301);
    const double turns = 0.001 * *rc::gen::inRange(0, 500);
    const auto noise = *rc::gen::container<std::vector<int>>(
        kind == 1 ? static_cast<std::size_t>(length) : 0U, rc::gen::inRange(-1000, 1001));
    for (int i = 0; i < length; ++i) {
      double wanted = level;
      if (kind == 1) wanted = 0.002 * limits.displacement * noise[static_cast<std::size_t>(i)];
      if (kind == 2) wanted = level * std::sin(two_pi * turns * i);
      if (kind == 3) wanted = i % 3 == 0 ? nan : level;
      if (kind == 4) wanted = i % 2 == 0 ? 1e308 : -1e308;
      if (kind == 5) wanted = i % 5 == 0 ? std::numeric_limits<double>::infinity() : -level;
      if (kind == 6) wanted = level * turns * i;
      watched.next(wanted);
    }
    RC_ASSERT(watched.within_limits());
  }
}

// A step across the whole range towards a value one rounding beyond the bound: the differences are
// bit-identical, the values are not.
TEST(BaseLimits, AValueOneRoundingBeyondTheBoundIsLimited) {
  constexpr double wall = 0x1.41d51f35aa45p-13;
  Watched watched({wall, 0x1.f89583ad75cfp-6, 0x1.80b980a2c83adp+2}, 1e-2);
  for (int i = 0; i < 50; ++i) watched.next(-2.0 * wall);
  watched.next(0x1.41d51f35aa451p-13);
  EXPECT_TRUE(watched.within_limits());
  EXPECT_LE(watched.stage().value(), wall);
}

// Worst-case input: always towards the farther bound, at the worst moment. Long, so that rounding
// errors accumulate.
TEST(BaseLimits, HoldAgainstAnAdversaryThatSeesTheState) {
  for (const MotionLimits& limits :
       {usual, MotionLimits{0.1, 0.05, 0.5}, MotionLimits{1e-3, 5.0, 900.0}}) {
    for (const double period_s : {1e-2, 1e-3, 5e-5}) {
      Watched watched(limits, period_s);
      bool up = true;
      for (int i = 0; i < 200'000; ++i) {
        const double x = watched.stage().value();
        if (std::abs(x) >= 0.999999 * limits.displacement) up = x < 0.0;
        if (i % 7919 == 0) up = !up;
        watched.next(up ? 1.0 : -1.0);
      }
      EXPECT_TRUE(watched.within_limits()) << limits.acceleration << " at " << period_s << " s";
    }
  }
}

// Sequences within the limits pass bit-identically.
RC_GTEST_PROP(BaseLimits, PassSequencesWithinThemBitIdentically, ()) {
  const double frequency_hz = 0.1 * *rc::gen::inRange(1, 200);
  const double start_turns = *rc::gen::element(0.25, 0.75);
  const double omega = two_pi * frequency_hz;
  const double level =
      std::min({usual.displacement, usual.velocity / omega, usual.acceleration / (omega * omega)});
  Watched watched(usual, h);
  const double turning_point = level * std::sin(two_pi * start_turns);
  for (int i = 1; i <= 4000; ++i) {
    const double t = i / 4000.0;
    const double wanted = turning_point * t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
    RC_ASSERT(watched.next(wanted) == wanted);
  }
  for (int i = 0; i < 5000; ++i) {
    const double wanted = level * std::sin(two_pi * start_turns + omega * h * i);
    RC_ASSERT(watched.next(wanted) == wanted);
  }
  RC_ASSERT(watched.within_limits());
}

TEST(BaseLimits, OnePercentBeyondALimitIsLimitedAndReported) {
  const auto limited_by = [](const MotionLimits& limits) {
    BaseLimits stage(limits, h);
    // 10 mm at 3 Hz: 0.188 m/s, 3.55 m/s^2; the amplitude grows within two seconds.
    for (int i = 0; i < 6000; ++i) {
      const double grown = std::min(1.0, i / 2000.0);
      stage.next(0.01 * grown * grown * (3.0 - 2.0 * grown) * std::sin(two_pi * 3.0 * h * i));
    }
    return stage.counts();
  };
  const auto index = [](Limit limit) { return static_cast<std::size_t>(limit); };
  const auto free = limited_by({0.0101, 0.191, 3.65});
  EXPECT_EQ(free[index(Limit::none)], 6000U);
  EXPECT_GT(limited_by({0.0099, 0.191, 3.65})[index(Limit::displacement)], 10U);
  EXPECT_GT(limited_by({0.0101, 0.186, 3.65})[index(Limit::velocity)], 10U);
  EXPECT_GT(limited_by({0.0101, 0.191, 3.50})[index(Limit::acceleration)], 10U);
}

// A step is reached with half of the acceleration and without any overshoot.
RC_GTEST_PROP(BaseLimits, ReachAStepWithoutOvershoot, ()) {
  BaseLimits stage(usual, h);
  double from = 0.0;
  for (int k = 0; k < 5; ++k) {
    const double to = usual.displacement * (*rc::gen::inRange(-1500, 1501) / 1500.0);
    int cycles = 0;
    while (stage.value() != to) {
      const double before = stage.value();
      const double x = stage.next(to);
      RC_ASSERT((to >= from ? x >= before && x <= to : x <= before && x >= to));
      RC_ASSERT(++cycles < 400);
    }
    for (int i = 0; i < 3; ++i) RC_ASSERT(stage.next(to) == to);
    from = to;
  }
}

// After a jump of phase the signal is rejoined exactly.
TEST(BaseLimits, RejoinAMovingSignal) {
  BaseLimits stage(usual, h);
  double phase = 0.0;
  int limited = 0;
  for (int i = 0; i < 8000; ++i) {
    phase += two_pi * 3.0 * h;
    if (i == 3037 || i == 5511) phase += 1.3;
    const double grown = std::min(1.0, i / 2000.0);
    const double wanted = 0.01 * grown * grown * (3.0 - 2.0 * grown) * std::sin(phase);
    const double x = stage.next(wanted);
    if (x != wanted) ++limited;
    EXPECT_EQ(x != wanted, stage.limited() != Limit::none);
    ASSERT_LE(std::abs(x), 0.0101);
  }
  EXPECT_GT(limited, 10);
  EXPECT_LT(limited, 400);
}

TEST(BaseLimits, ValuesThatAreNotFiniteHoldAndThenComeToRestAtZero) {
  BaseLimits stage(usual, h);
  for (int i = 0; i < 500; ++i) stage.next(0.01 * std::sin(two_pi * 0.5 * h * i));
  const double held = stage.value();
  ASSERT_NEAR(held, 0.01, 1e-4);
  for (int i = 0; i < 20; ++i) {
    stage.next(nan);
    EXPECT_EQ(stage.limited(), Limit::not_finite);
    EXPECT_NEAR(stage.value(), held, 5e-4);
  }
  for (int i = 0; i < 1100; ++i) stage.next(nan);
  EXPECT_EQ(stage.value(), 0.0);
  EXPECT_TRUE(stage.is_at_zero());
  EXPECT_EQ(stage.counts()[static_cast<std::size_t>(Limit::not_finite)], 1120U);
  stage.next(1e-6);
  EXPECT_EQ(stage.limited(), Limit::none);
  EXPECT_EQ(stage.value(), 1e-6);
}

TEST(BaseLimits, AForceHasNoLimitOfItsSecondDifference) {
  BaseLimits stage({2.0, 10.0, std::numeric_limits<double>::infinity()}, h);
  double before = 0.0;
  for (int i = 0; i < 1000; ++i) {
    const double x = stage.next(i < 500 ? 5.0 : -1.0);
    ASSERT_LE(std::abs(x - before), 10.0 * h);
    ASSERT_LE(std::abs(x), 2.0);
    before = x;
    if (i == 250) {
      EXPECT_EQ(x, 2.0);
      EXPECT_EQ(stage.limited(), Limit::displacement);
    }
  }
  EXPECT_EQ(before, -1.0);
}

TEST(BaseLimits, ResetStopsTheMotion) {
  BaseLimits stage(usual, h);
  for (int i = 0; i < 100; ++i) stage.next(0.01);
  stage.reset();
  EXPECT_EQ(stage.value(), 0.0);
  EXPECT_EQ(stage.next(0.0), 0.0);
  EXPECT_EQ(stage.limited(), Limit::none);
}

TEST(BaseLimits, AreRefusedIfInvalid) {
  EXPECT_THROW(BaseLimits({0.0, 1.0, 1.0}, h), std::invalid_argument);
  EXPECT_THROW(BaseLimits({1.0, -1.0, 1.0}, h), std::invalid_argument);
  EXPECT_THROW(BaseLimits({1.0, 1.0, nan}, h), std::invalid_argument);
  EXPECT_THROW(BaseLimits({1.0, 1.0, 1.0}, 0.0), std::invalid_argument);
  EXPECT_THROW(BaseLimits({1.0, 1.0, 1e-6}, 5e-5), std::invalid_argument);
}

}  // namespace
}  // namespace stickslip::daemon
