// SPDX-License-Identifier: Apache-2.0
#include "physics/simulator.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "tests/unit/physics/rigs.h"

namespace stickslip::physics {
namespace {

Input base_at(double t) {
  const double w = 2.0 * std::numbers::pi * 3.0;
  Input input;
  input.base_displacement_m = 0.006 * std::sin(w * t);
  input.base_acceleration_m_s2 = -0.006 * w * w * std::sin(w * t);
  return input;
}

std::vector<Frame> frames_of(const Model& model, SimulationOptions options, int count) {
  RigSimulator rig(model, options);
  std::vector<Frame> frames;
  for (int k = 1; k <= count; ++k) {
    rig.advance(1.0e-3, base_at(1.0e-3 * k));
    frames.push_back(rig.read());
  }
  return frames;
}

TEST(Simulator, IsDeterminedByItsSeed) {
  Model model = test::bench();
  for (Sensor& sensor : model.sensors) sensor.noise_std = 1.0e-4;
  const auto one = frames_of(model, {.seed = 5}, 300);
  EXPECT_EQ(one, frames_of(model, {.seed = 5}, 300));
  EXPECT_NE(one, frames_of(model, {.seed = 6}, 300));
}

TEST(Simulator, AddsTheDeclaredNoise) {
  Model model = test::bench();
  model.sensors[index_of(Channel::displacement)].noise_std = 3.0e-5;
  model.sensors[index_of(Channel::friction_force)].noise_std = 7.0e-4;
  const int count = 20000;
  const auto noisy = frames_of(model, {.seed = 2}, count);
  const auto clean = frames_of(model, {.noise = false}, count);
  for (const Channel channel : {Channel::displacement, Channel::friction_force}) {
    double sum = 0.0;
    double square = 0.0;
    double lagged = 0.0;
    double before = 0.0;
    for (std::size_t k = 0; k < noisy.size(); ++k) {
      const double noise = noisy[k][channel] - clean[k][channel];
      sum += noise;
      square += noise * noise;
      lagged += noise * before;
      before = noise;
    }
    const double declared = *model.sensors[index_of(channel)].noise_std;
    EXPECT_NEAR(std::sqrt(square / count), declared, 0.02 * declared);
    EXPECT_LT(std::abs(sum / count), 4.0 * declared / std::sqrt(count));
    EXPECT_LT(std::abs(lagged / square), 4.0 / std::sqrt(count)) << "white";
  }
  // No noise in a channel without noise_std.
  EXPECT_EQ(noisy.back()[Channel::velocity], clean.back()[Channel::velocity]);
}

TEST(Simulator, QuantisesToItsResolution) {
  SimulationOptions options;
  options.resolution[index_of(Channel::displacement)] = 1.0e-4;
  double largest = 0.0;
  for (const Frame& frame : frames_of(test::bench(), options, 500)) {
    const double counts = frame[Channel::displacement] / 1.0e-4;
    ASSERT_NEAR(counts, std::round(counts), 1.0e-6);
    largest = std::max(largest, std::abs(counts));
  }
  EXPECT_GT(largest, 3.0);
}

TEST(Simulator, ReadsTheChannelsThatTheRigHas) {
  const auto has = [](const Model& model, Channel channel) {
    return RigSimulator(model).read().has(channel);
  };
  Model model = test::bench();
  EXPECT_TRUE(has(model, Channel::displacement));
  EXPECT_TRUE(has(model, Channel::velocity));
  EXPECT_TRUE(has(model, Channel::friction_force));
  EXPECT_TRUE(has(model, Channel::normal_load));
  EXPECT_TRUE(has(model, Channel::base_displacement));
  EXPECT_FALSE(has(model, Channel::drive_force));
  model.oscillator.excitation = Excitation::force;
  EXPECT_FALSE(has(model, Channel::base_displacement));
  EXPECT_TRUE(has(model, Channel::drive_force));
  model.normal_load.reset();
  EXPECT_FALSE(has(model, Channel::normal_load));
  model.friction = {};
  EXPECT_FALSE(has(model, Channel::friction_force));
  model = {};
  model.oscillator.excitation = Excitation::imposed;
  EXPECT_FALSE(has(model, Channel::base_displacement));
  EXPECT_FALSE(has(model, Channel::drive_force));
  EXPECT_TRUE(has(model, Channel::displacement));
}

TEST(Simulator, DelaysTheReadingOfAnInput) {
  Model model;
  model.oscillator.excitation = Excitation::force;
  model.oscillator.mass_kg = {1.0};
  model.oscillator.stiffness_n_m = Parameter{100.0};
  model.oscillator.damping_n_s_m = Parameter{1.0};
  Model late = model;
  late.terms.push_back({"channel_delay", Channel::drive_force, {{"delay_s", {0.0075}}}});
  RigSimulator prompt_rig(model);
  RigSimulator late_rig(late);
  const auto force = [](double time_s) {
    Input input;
    input.drive_force_n = 3.0 * time_s;
    return input;
  };
  for (int k = 1; k <= 40; ++k) {
    prompt_rig.advance(1.0e-3, force(1.0e-3 * k));
    late_rig.advance(1.0e-3, force(1.0e-3 * k));
  }
  const Frame prompt_frame = prompt_rig.read();
  const Frame late_frame = late_rig.read();
  EXPECT_NEAR(prompt_frame[Channel::drive_force], 3.0 * 0.04, 1.0e-12);
  EXPECT_NEAR(late_frame[Channel::drive_force], 3.0 * (0.04 - 0.0075), 1.0e-9);
  // The delay does not affect the motion.
  EXPECT_EQ(late_frame[Channel::displacement], prompt_frame[Channel::displacement]);
}

TEST(Simulator, CountsFramesAndTime) {
  const auto frames = frames_of(test::bench(), {}, 1000);
  EXPECT_EQ(frames.front().sequence, 0U);
  EXPECT_EQ(frames.back().sequence, 999U);
  EXPECT_EQ(frames.back().time_ns, 1'000'000'000);
}

// The motion does not depend on the number of calls.
TEST(Simulator, IsIndependentOfThePieces) {
  Input end;
  end.base_acceleration_m_s2 = 3.0;
  RigSimulator one(test::bench());
  RigSimulator many(test::bench());
  one.advance(0.02, end);
  for (int k = 1; k <= 10; ++k) many.advance(0.002, between({}, end, 0.1 * k));
  EXPECT_NEAR(one.truth().displacement_m, many.truth().displacement_m, 1.0e-12);
  EXPECT_NEAR(one.truth().theta, many.truth().theta, 1.0e-9);
}

TEST(Simulator, StartsFromTheGivenState) {
  RigTruth start;
  start.displacement_m = 0.01;
  start.velocity_m_s = -0.2;
  RigSimulator rig(test::rigid_bench(), {}, start);
  const Frame frame = rig.read();
  EXPECT_DOUBLE_EQ(frame[Channel::displacement], 0.01);
  EXPECT_DOUBLE_EQ(frame[Channel::velocity], -0.2);
  EXPECT_NEAR(rig.truth().theta, -1.0, 1.0e-9);
}

}  // namespace
}  // namespace stickslip::physics
