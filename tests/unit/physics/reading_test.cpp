// SPDX-License-Identifier: Apache-2.0
#include "physics/reading.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "physics/rig.h"
#include "physics/sensor_chain.h"
#include "physics/simulator.h"
#include "tests/unit/physics/rigs.h"

namespace stickslip::physics {
namespace {

using std::numbers::pi;

// Recordings of the same driven rig at 1 kHz for a second: as declared, and with a sensor error.
struct Pair {
  std::vector<Frame> declared;
  std::vector<Frame> faulty;
};

std::vector<Frame> recorded(const Model& model) {
  SimulationOptions options;
  options.noise = false;
  RigSimulator rig(model, options);
  std::vector<Frame> frames;
  for (int k = 1; k <= 1000; ++k) {
    Input now;
    const double t = 1.0e-3 * k;
    now.base_displacement_m = 0.005 * std::sin(2.0 * pi * 2.9 * t);
    now.base_acceleration_m_s2 =
        -0.005 * std::pow(2.0 * pi * 2.9, 2) * std::sin(2.0 * pi * 2.9 * t);
    rig.advance(1.0e-3, now);
    frames.push_back(rig.read());
  }
  return frames;
}

Pair with(const Term& term) {
  Model model = test::bench();
  Pair pair;
  pair.declared = recorded(model);
  model.terms.push_back(term);
  pair.faulty = recorded(model);
  return pair;
}

constexpr Channel f = Channel::friction_force;
constexpr Channel v = Channel::velocity;

// reading = gain (quantity, delay_s ago) + offset, for predicted channels and for those of the
// drive.
TEST(Reading, FollowsTheDeclaredInstrument) {
  Model model = test::bench();
  const std::vector<Frame> exact = recorded(model);
  Sensor& sensor = model.sensors[index_of(v)];
  sensor.gain = Parameter{1.02};
  sensor.offset = Parameter{-0.003};
  sensor.delay_s = Parameter{0.004};
  model.sensors[index_of(Channel::base_displacement)].offset = Parameter{0.001};
  const std::vector<Frame> read = recorded(model);
  for (std::size_t k = 100; k < read.size(); ++k) {
    EXPECT_NEAR(read[k][v], 1.02 * exact[k - 4][v] - 0.003, 1.0e-9);
    EXPECT_EQ(read[k][f], exact[k][f]);
    EXPECT_NEAR(read[k][Channel::base_displacement], exact[k][Channel::base_displacement] + 0.001,
                1.0e-12);
  }
}

// Below its cut-off a low-pass is a delay: a cut-off that is 2 % off, and its declared uncertainty.
TEST(Reading, CutOffsAreParametersWithTheDelayOfTheirFilters) {
  Model model = test::bench();
  auto& filters = model.sensors[index_of(Channel::displacement)].filters;
  filters = {{FilterKind::butterworth_lowpass, 4, {25.0, 0.5}}};
  const Rig rig(model);
  auto values = rig.parameter_values();
  const auto& paths = rig.parameter_paths();
  const auto at = std::find(paths.begin(), paths.end(), "sensors.displacement.filters.0.cutoff_hz");
  ASSERT_NE(at, paths.end());
  values[static_cast<std::size_t>(at - paths.begin())] = 25.5;
  const auto laws = rig.numbers<double>(std::span<const double>(values)).reading;
  const double lag_s = FilterChain(filters, 1.0e-3).lag_s();
  const double change_s = lag_s * (25.0 / 25.5 - 1.0);
  EXPECT_NEAR(laws.of[index_of(Channel::displacement)].delay_s, change_s, 1.0e-12);
  EXPECT_NEAR(laws.of[index_of(v)].delay_s, change_s, 1.0e-12) << "the velocity chain follows it";
}

TEST(Reading, NoiseHasTheDeclaredCorrelationTime) {
  Model model = test::bench();
  Sensor& sensor = model.sensors[index_of(v)];
  sensor.noise_std = 0.01;
  sensor.noise_correlation_s = 0.02;
  SimulationOptions options;
  options.seed = 3;
  RigSimulator rig(model, options);
  double square = 0.0;
  double product = 0.0;
  double last = 0.0;
  for (int k = 0; k < 20000; ++k) {
    rig.advance(1.0e-3, {});
    const double noise = rig.read()[v];
    square += noise * noise;
    product += noise * last;
    last = noise;
  }
  EXPECT_NEAR(std::sqrt(square / 20000.0), 0.01, 0.001);
  EXPECT_NEAR(product / square, std::exp(-0.05), 0.01);
}

TEST(Reading, GainErrorScalesItsChannelOnly) {
  const Pair pair = with({"gain_error", v, {{"gain", {1.2}}}});
  for (std::size_t k = 0; k < pair.declared.size(); ++k) {
    EXPECT_NEAR(pair.faulty[k][v], 1.2 * pair.declared[k][v], 1.0e-15);
    EXPECT_EQ(pair.faulty[k][f], pair.declared[k][f]);
  }
}

TEST(Reading, ChannelDelayShiftsItsChannelOnly) {
  const Pair pair = with({"channel_delay", f, {{"delay_s", {0.007}}}});
  double largest = 0.0;
  for (std::size_t k = 50; k < pair.declared.size(); ++k) {
    largest = std::max(largest, std::abs(pair.declared[k][f]));
    EXPECT_NEAR(pair.faulty[k][f], pair.declared[k - 7][f], 1.0e-9) << k;
    EXPECT_EQ(pair.faulty[k][v], pair.declared[k][v]);
  }
  EXPECT_GT(largest, 0.01);
}

TEST(Reading, IncludesCrosstalkDriftHumAndClipping) {
  Term crosstalk{"crosstalk", v, {{"coefficient", {0.3}}}, f};
  const Pair mixed = with(crosstalk);
  const Pair drifting = with({"sensor_drift", f, {{"rate_per_s", {0.02}}}});
  const Pair settling = with({"sensor_drift", f, {{"rate_per_s", {0.02}}, {"approach_s", {0.3}}}});
  const Pair humming = with(
      {"mains_hum", f, {{"frequency_hz", {50.0}}, {"amplitude", {0.01}}, {"phase_rad", {0.4}}}});
  const Pair clipped = with({"clipping", v, {{"limit", {0.005}}}});
  bool reached = false;
  for (std::size_t k = 0; k < 1000; ++k) {
    const double t = 1.0e-3 * static_cast<double>(k + 1);
    EXPECT_NEAR(mixed.faulty[k][v], mixed.declared[k][v] + 0.3 * mixed.declared[k][f], 1.0e-12);
    EXPECT_NEAR(drifting.faulty[k][f], drifting.declared[k][f] + 0.02 * t, 1.0e-12);
    EXPECT_NEAR(settling.faulty[k][f],
                settling.declared[k][f] + 0.02 * 0.3 * (1.0 - std::exp(-t / 0.3)), 1.0e-12);
    EXPECT_NEAR(humming.faulty[k][f],
                humming.declared[k][f] + 0.01 * std::sin(2.0 * pi * 50.0 * t + 0.4), 1.0e-9);
    const double free = clipped.declared[k][v];
    EXPECT_NEAR(clipped.faulty[k][v], std::clamp(free, -0.005, 0.005), 1.0e-15);
    reached = reached || std::abs(free) > 0.005;
  }
  EXPECT_TRUE(reached);
}

TEST(Reading, IsCorrectedIfItsLawIsInvertible) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  for (int k = 0; k < 1000; ++k) {
    ReadingLaw<double> law;
    law.gain = std::exp(any(random));
    law.curvature = 0.15 * any(random);
    const double truth = any(random);
    const double reading = reading_of(law, truth, 0.0);
    const auto corrected = correct_reading(law, reading);
    ASSERT_TRUE(corrected);
    EXPECT_NEAR(corrected->value, truth, 1.0e-13);
    const double next = correct_reading(law, reading + 1.0e-6)->value;
    EXPECT_NEAR(corrected->slope, (next - truth) / 1.0e-6, 1.0e-4);
  }
  ReadingLaw<double> law;
  law.curvature = -1.0;
  EXPECT_FALSE(correct_reading(law, 0.3)) << "the largest possible reading is 0.25";
  EXPECT_FALSE(correct_reading(law, 0.24));
  EXPECT_TRUE(correct_reading(law, 0.2));
  EXPECT_TRUE(correct_reading(law, -5.0));
}

// A first-order low-pass of 30 Hz delays a slow velocity by 1 / (2 pi 30) s, in place of the 150 Hz
// that the bench declares.
TEST(Reading, SlowDifferentiatorDelaysTheVelocity) {
  const Pair pair = with({"differentiator_lag", {}, {{"cutoff_hz", {30.0}}}});
  Model declared = test::bench();
  declared.sensors[index_of(v)].filters = {{FilterKind::first_order_lowpass, 1, 30.0}};
  const std::vector<Frame> direct = recorded(declared);
  for (std::size_t k = 0; k < direct.size(); ++k) {
    EXPECT_NEAR(pair.faulty[k][v], direct[k][v], 1.0e-5) << k;
    EXPECT_EQ(pair.faulty[k][Channel::displacement], direct[k][Channel::displacement]);
  }
}

}  // namespace
}  // namespace stickslip::physics
