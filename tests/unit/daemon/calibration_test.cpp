// SPDX-License-Identifier: Apache-2.0
#include "daemon/calibration.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>

namespace stickslip::daemon {
namespace {

TEST(Calibration, AppliesOffsetThenGain) {
  config::ChannelCalibrations channels{};
  channels[index_of(Channel::displacement)] = {2.5, 0.004};
  Frame raw;
  raw.time_ns = 17;
  raw.sequence = 4;
  raw.set(Channel::displacement, 3.0);
  const Calibrated out = calibrated(raw, Calibration(channels));
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

TEST(Calibration, NotFiniteReadingsBecomeInvalidAndAreMarked) {
  config::ChannelCalibrations channels{};
  channels[index_of(Channel::normal_load)].gain = 1e300;
  Frame raw;
  for (Channel channel : all_channels) raw.set(channel, 1.0);
  raw.value[index_of(Channel::velocity)] = std::numeric_limits<double>::quiet_NaN();
  raw.value[index_of(Channel::drive_force)] = -std::numeric_limits<double>::infinity();
  raw.value[index_of(Channel::normal_load)] = 1e300;  // finite before the gain
  const Calibrated out = calibrated(raw, Calibration(channels));
  EXPECT_EQ(out.not_finite, 0b101010);
  EXPECT_EQ(out.frame.valid, 0b010101);
  for (const double value : out.frame.value) EXPECT_TRUE(value == 0.0 || value == 1.0);
}

TEST(Calibration, IdentityKeepsEveryBit) {
  for (const double value : {0.0, 5e-324, 1.0 / 3.0, -1.7976931348623157e308}) {
    Frame raw;
    raw.set(Channel::friction_force, value);
    const Calibrated out = calibrated(raw, Calibration{});
    EXPECT_EQ(std::bit_cast<std::uint64_t>(out.frame[Channel::friction_force]),
              std::bit_cast<std::uint64_t>(value));
  }
}

TEST(Calibration, AZeroHasNoSign) {
  Frame raw;
  raw.set(Channel::friction_force, -0.0);
  const Calibrated out = calibrated(raw, Calibration{});
  EXPECT_FALSE(std::signbit(out.frame[Channel::friction_force]));
}

TEST(Calibration, AgesAreKept) {
  Frame raw;
  raw.set(Channel::normal_load, 1.0);
  raw.age_us[index_of(Channel::normal_load)] = 8000;
  const Calibrated out = calibrated(raw, Calibration{});
  EXPECT_EQ(out.frame, raw);
}

config::ChannelCalibrations with_crosstalk() {
  config::ChannelCalibrations channels{};
  channels[index_of(Channel::friction_force)] = {0.5, 2.0};
  channels[index_of(Channel::friction_force)].crosstalk[index_of(Channel::normal_load)] = 0.012;
  channels[index_of(Channel::normal_load)] = {-0.25, 3.0};
  channels[index_of(Channel::normal_load)].crosstalk[index_of(Channel::friction_force)] = -0.03;
  channels[index_of(Channel::normal_load)].crosstalk[index_of(Channel::displacement)] = 40.0;
  return channels;
}

TEST(Calibration, CorrectsCrosstalk) {
  const config::ChannelCalibrations channels = with_crosstalk();
  const Calibration calibration(channels);
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  for (int round = 0; round < 100; ++round) {
    // True values, the readings that follow from them, and the calibrated values.
    Frame truth;
    for (Channel channel : all_channels) truth.set(channel, normal(random));
    Frame raw = truth;
    for (std::size_t i = 0; i < channel_count; ++i) {
      double reading = truth.value[i];
      for (std::size_t j = 0; j < channel_count; ++j) {
        reading += channels[i].crosstalk[j] * truth.value[j];
      }
      raw.value[i] = reading / channels[i].gain + channels[i].offset;
    }
    const Calibrated out = calibrated(raw, calibration);
    EXPECT_EQ(out.frame.valid, 0b111111);
    for (std::size_t i = 0; i < channel_count; ++i) {
      EXPECT_NEAR(out.frame.value[i], truth.value[i], 1e-12);
    }
    // Channels without crosstalk are bit-identical.
    EXPECT_EQ(out.frame[Channel::velocity], raw[Channel::velocity]);
    EXPECT_EQ(out.frame[Channel::displacement], raw[Channel::displacement]);
  }
}

TEST(Calibration, SourcesOfCrosstalkMustBeValidAndPassOnTheirAge) {
  const Calibration calibration(with_crosstalk());
  Frame raw;
  for (Channel channel : all_channels) raw.set(channel, 1.0);
  raw.age_us[index_of(Channel::displacement)] = 700;
  raw.age_us[index_of(Channel::normal_load)] = 20;
  const Calibrated all = calibrated(raw, calibration);
  EXPECT_EQ(all.uncorrected, 0U);
  EXPECT_EQ(all.frame.age_us, (std::array{700, 0, 700, 700, 0, 0})) << "through the load as well";
  raw.invalidate(Channel::displacement);
  const Calibrated some = calibrated(raw, calibration);
  EXPECT_EQ(some.uncorrected, 0b001100);
  EXPECT_EQ(some.frame.valid, 0b110010);
  EXPECT_EQ(some.frame[Channel::friction_force], 0.0);
  EXPECT_EQ(some.not_finite, 0U);
}

TEST(Calibration, ValuesOutsideTheRangeAreMarkedAndKept) {
  config::ChannelCalibrations channels{};
  channels[index_of(Channel::normal_load)].gain = 2.0;
  channels[index_of(Channel::normal_load)].valid = config::ValidRange{0.0, 2.0};
  channels[index_of(Channel::velocity)].valid = config::ValidRange{-1.0, 1.0};
  const Calibration calibration(channels);
  const auto marked = [&](double load) {
    Frame raw;
    raw.set(Channel::normal_load, load);
    const Calibrated out = calibrated(raw, calibration);
    EXPECT_TRUE(out.frame.has(Channel::normal_load));
    EXPECT_EQ(out.frame[Channel::normal_load], 2.0 * load);
    return out.out_of_range;
  };
  EXPECT_EQ(marked(0.0), 0U);
  EXPECT_EQ(marked(1.0), 0U);
  EXPECT_EQ(marked(1.0001), 0b001000) << "an invalid velocity is not marked";
  EXPECT_EQ(marked(-0.0001), 0b001000);
}

TEST(Calibration, UncertaintyAgreesWithMonteCarloCalibrations) {
  config::ChannelCalibrations channels = with_crosstalk();
  channels[index_of(Channel::friction_force)].covariance = {4e-4, 1e-4, 1e-4};
  channels[index_of(Channel::normal_load)].covariance = {1e-4, 0.0, 9e-4};
  Frame raw;
  for (Channel channel : all_channels) raw.set(channel, 0.7);
  const Calibration calibration(channels);
  const double sigma =
      calibration.sigma(calibrated(raw, calibration).frame, Channel::friction_force);
  // Offsets and gains drawn from their covariances.
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  double sum = 0.0;
  double squares = 0.0;
  constexpr int rounds = 20000;
  for (int round = 0; round < rounds; ++round) {
    config::ChannelCalibrations other = channels;
    for (config::ChannelCalibration& each : other) {
      if (each.covariance.offset == 0.0) continue;
      const double a = normal(random);
      const double root = std::sqrt(each.covariance.offset);
      const double share = each.covariance.offset_gain / root;
      each.offset += root * a;
      each.gain += share * a + std::sqrt(each.covariance.gain - share * share) * normal(random);
    }
    const double si = calibrated(raw, Calibration(other)).frame[Channel::friction_force];
    sum += si;
    squares += si * si;
  }
  const double spread = std::sqrt(squares / rounds - (sum / rounds) * (sum / rounds));
  EXPECT_NEAR(sigma / spread, 1.0, 0.03);
  EXPECT_EQ(Calibration{}.sigma(raw, Channel::velocity), 0.0);
}

TEST(Calibration, ReportsADifferentUnitThanTheDevices) {
  config::ChannelCalibrations channels{};
  channels[index_of(Channel::velocity)].raw_unit = std::string("V");
  channels[index_of(Channel::normal_load)].raw_unit = std::string("V/V");
  channels[index_of(Channel::friction_force)].raw_unit = std::string("V/V");
  drivers::Description device;
  device.name = "bridge";
  device.unit[index_of(Channel::normal_load)] = "counts";
  device.unit[index_of(Channel::friction_force)] = "V/V";
  const auto disagreements = unit_disagreements(channels, device);
  ASSERT_EQ(disagreements.size(), 1U);
  EXPECT_EQ(disagreements[0].find("normal_load was calibrated in V/V, but bridge reads in counts"),
            0U);
}

}  // namespace
}  // namespace stickslip::daemon
