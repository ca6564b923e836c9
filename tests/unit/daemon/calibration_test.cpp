#include "daemon/calibration.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <limits>

namespace stickslip::daemon {
namespace {

TEST(Calibration, TakesOffsetThenGain) {
  Calibration calibration{};
  calibration[index_of(Channel::displacement)] = {2.5, 0.004};
  Frame raw;
  raw.time_ns = 17;
  raw.sequence = 4;
  raw.set(Channel::displacement, 3.0);
  const Calibrated out = calibrated(raw, calibration);
  EXPECT_DOUBLE_EQ(out.frame[Channel::displacement], 0.002);
  EXPECT_EQ(out.frame.time_ns, 17);
  EXPECT_EQ(out.frame.sequence, 4U);
  EXPECT_EQ(out.frame.valid, 1U);
  EXPECT_EQ(out.not_finite, 0U);
}

TEST(Calibration, InvalidStaysInvalidAndIsZero) {
  Frame raw;
  raw.value.fill(7.0);
  raw.valid = 0b000010;
  const Calibrated out = calibrated(raw, Calibration{});
  EXPECT_EQ(out.frame.valid, 0b000010);
  EXPECT_EQ(out.frame[Channel::velocity], 7.0);
  EXPECT_EQ(out.frame[Channel::displacement], 0.0);
}

TEST(Calibration, WhatIsNotFiniteBecomesInvalidAndIsNamed) {
  Calibration calibration{};
  calibration[index_of(Channel::normal_load)].gain = 1e300;
  Frame raw;
  for (Channel channel : all_channels) raw.set(channel, 1.0);
  raw.value[index_of(Channel::velocity)] = std::numeric_limits<double>::quiet_NaN();
  raw.value[index_of(Channel::drive_force)] = -std::numeric_limits<double>::infinity();
  raw.value[index_of(Channel::normal_load)] = 1e300;  // finite until the gain
  const Calibrated out = calibrated(raw, calibration);
  EXPECT_EQ(out.not_finite, 0b101010);
  EXPECT_EQ(out.frame.valid, 0b010101);
  for (const double value : out.frame.value) EXPECT_TRUE(value == 0.0 || value == 1.0);
}

TEST(Calibration, IdentityKeepsEveryBit) {
  for (const double value : {-0.0, 0.0, 5e-324, 1.0 / 3.0, -1.7976931348623157e308}) {
    Frame raw;
    raw.set(Channel::friction_force, value);
    const Calibrated out = calibrated(raw, Calibration{});
    EXPECT_EQ(std::bit_cast<std::uint64_t>(out.frame[Channel::friction_force]),
              std::bit_cast<std::uint64_t>(value));
  }
}

}  // namespace
}  // namespace stickslip::daemon
