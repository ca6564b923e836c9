// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulated/simulated_driver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "config/rig.h"
#include "drivers/factory/make_driver.h"

namespace stickslip::drivers {
namespace {

constexpr double period_s = 1.0e-3;
constexpr double two_pi = 2.0 * std::numbers::pi;

const config::Rig& shipped() {
  static const config::Rig rig = config::load_rig(STICKSLIP_SOURCE_DIR "/config/simulated.toml");
  return rig;
}

double sine(int i) { return 0.008 * std::sin(two_pi * 3.0 * i * period_s); }

std::vector<Frame> run(Driver& driver, int count) {
  std::vector<Frame> frames;
  EXPECT_TRUE(driver.open());
  EXPECT_TRUE(driver.start());
  for (int i = 0; i < count; ++i) {
    Frame frame;
    EXPECT_TRUE(driver.read(frame));
    frames.push_back(frame);
    EXPECT_TRUE(driver.write({sine(i), true}));
  }
  driver.stop();
  driver.close();
  return frames;
}

/// Amplitude of the sine of 3 Hz in a channel, over whole periods.
double amplitude_of(const std::vector<Frame>& frames, Channel channel, std::size_t from) {
  double a = 0.0;
  double b = 0.0;
  const auto count = static_cast<double>(frames.size() - from);
  for (std::size_t i = from; i < frames.size(); ++i) {
    const double phase = two_pi * 3.0 * frames[i].time_s();
    a += frames[i][channel] * std::sin(phase);
    b += frames[i][channel] * std::cos(phase);
  }
  return 2.0 / count * std::hypot(a, b);
}

TEST(SimulatedDriver, IdentifiesItself) {
  SimulatedDriver driver(shipped().simulated, period_s);
  ASSERT_TRUE(driver.open());
  const Description& description = driver.description();
  EXPECT_EQ(description.name, "simulated rig");
  EXPECT_TRUE(description.can_drive);
  EXPECT_FALSE(description.paced);
  for (const Channel channel : all_channels) {
    EXPECT_EQ((description.channels >> index_of(channel)) & 1, channel != Channel::drive_force);
    EXPECT_EQ(description.unit[index_of(channel)], info(channel).unit);
  }
}

TEST(SimulatedDriver, FramesComeAtTheRateWithoutAGap) {
  SimulatedDriver driver(shipped().simulated, 1.0 / 3000.0);
  const auto frames = run(driver, 3001);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    ASSERT_EQ(frames[i].sequence, i);
    ASSERT_EQ(frames[i].time_ns, std::llround(static_cast<double>(i) * 1.0e9 / 3000.0));
    ASSERT_EQ(frames[i].valid, frames[0].valid);
    for (const double value : frames[i].value) ASSERT_TRUE(std::isfinite(value));
  }
}

TEST(SimulatedDriver, TheSameSeedGivesTheSameBytesAndAnotherDoesNot) {
  config::SimulatedDriver settings = shipped().simulated;
  SimulatedDriver one(settings, period_s);
  SimulatedDriver two(settings, period_s);
  const auto first = run(one, 500);
  EXPECT_EQ(first, run(two, 500));
  EXPECT_EQ(first, run(one, 500)) << "reopened";
  settings.seed += 1;
  SimulatedDriver other(settings, period_s);
  EXPECT_NE(first, run(other, 500));
}

TEST(SimulatedDriver, SineAmplitudeIsReproducedWithinTheNoise) {
  config::SimulatedDriver settings = shipped().simulated;
  settings.resolution = {};
  SimulatedDriver driver(settings, period_s);
  const auto frames = run(driver, 5000);
  const double noise = *settings.truth.sensors[index_of(Channel::base_displacement)].noise_std;
  const double tolerance = 5.0 * noise * std::sqrt(2.0 / 4000.0);
  EXPECT_NEAR(amplitude_of(frames, Channel::base_displacement, 1000), 0.008,
              tolerance + 2.0e-4 * 0.008);
  // It slips: the mass moves by more than the deflection of the load cell.
  EXPECT_GT(amplitude_of(frames, Channel::displacement, 1000), 2.0e-3);
}

TEST(SimulatedDriver, ReadingsAreQuantised) {
  config::SimulatedDriver settings = shipped().simulated;
  settings.resolution[index_of(Channel::displacement)] = 1.0e-4;
  SimulatedDriver driver(settings, period_s);
  for (const Frame& frame : run(driver, 500)) {
    const double steps = frame[Channel::displacement] / 1.0e-4;
    ASSERT_NEAR(steps, std::round(steps), 1.0e-9);
  }
}

TEST(SimulatedDriver, AnAbsentChannelIsNeverValid) {
  config::SimulatedDriver settings = shipped().simulated;
  settings.absent[index_of(Channel::velocity)] = true;
  SimulatedDriver driver(settings, period_s);
  for (const Frame& frame : run(driver, 50)) {
    ASSERT_FALSE(frame.has(Channel::velocity));
    ASSERT_EQ(frame[Channel::velocity], 0.0);
    ASSERT_TRUE(frame.has(Channel::displacement));
  }
  EXPECT_EQ(driver.description().channels & (1U << index_of(Channel::velocity)), 0U);
}

TEST(SimulatedDriver, RestsWhenStoppedAndContinuesFromThere) {
  config::SimulatedDriver settings = shipped().simulated;
  settings.noise = false;
  settings.resolution = {};
  SimulatedDriver driver(settings, period_s);
  ASSERT_TRUE(driver.open());
  ASSERT_TRUE(driver.start());
  Frame frame;
  for (int i = 0; i < 1200; ++i) {
    ASSERT_TRUE(driver.read(frame));
    ASSERT_TRUE(driver.write({sine(i), true}));
  }
  const Frame last = frame;
  driver.stop();
  ASSERT_TRUE(driver.start());
  for (int i = 0; i < 1500; ++i) ASSERT_TRUE(driver.read(frame));
  EXPECT_EQ(frame.sequence, last.sequence + 1500);
  EXPECT_NEAR(frame[Channel::base_displacement], 0.0, 1.0e-5);
}

TEST(SimulatedDriver, NonFiniteDriveIsAFaultAndCausesNoMotion) {
  config::SimulatedDriver settings = shipped().simulated;
  settings.noise = false;
  SimulatedDriver driver(settings, period_s);
  ASSERT_TRUE(driver.open());
  ASSERT_TRUE(driver.start());
  for (int i = 0; i < 50; ++i) {
    Frame frame;
    ASSERT_TRUE(driver.read(frame));
    EXPECT_EQ(frame[Channel::base_displacement], 0.0);
    const Result result = driver.write({std::numeric_limits<double>::quiet_NaN(), true});
    EXPECT_EQ(result.outcome, Outcome::fatal);
    EXPECT_STRNE(result.message, "");
  }
}

TEST(SimulatedDriver, ForceDrivesAForceExcitedRig) {
  config::SimulatedDriver settings;
  settings.truth.oscillator.excitation = physics::Excitation::force;
  settings.truth.oscillator.mass_kg = {1.0, 0.0};
  settings.truth.oscillator.stiffness_n_m = physics::Parameter{100.0, 0.0};
  settings.truth.oscillator.damping_n_s_m = physics::Parameter{20.0, 0.0};
  SimulatedDriver driver(settings, period_s);
  ASSERT_TRUE(driver.open());
  ASSERT_TRUE(driver.start());
  Frame frame;
  for (int i = 0; i < 3000; ++i) {
    ASSERT_TRUE(driver.read(frame));
    ASSERT_TRUE(driver.write({2.0, true}));
  }
  EXPECT_NEAR(frame[Channel::drive_force], 2.0, 1.0e-6);
  EXPECT_NEAR(frame[Channel::displacement], 0.02, 1.0e-6);
  EXPECT_FALSE(frame.has(Channel::base_displacement));
}

TEST(SimulatedDriver, InvalidTrueModelIsRejected) {
  config::SimulatedDriver settings = shipped().simulated;
  settings.truth.oscillator.mass_kg.value = -1.0;
  SimulatedDriver driver(settings, period_s);
  const Result result = driver.open();
  EXPECT_EQ(result.outcome, Outcome::needs_attention);
  EXPECT_THAT(result.message, testing::HasSubstr("true model of the simulated rig is invalid"));
  EXPECT_EQ(driver.start().outcome, Outcome::fatal);
}

TEST(SimulatedDriver, TheLifecycleMayBeCalledInAnyOrder) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    std::mt19937 random(seed);
    SimulatedDriver driver(shipped().simulated, period_s);
    bool open = false;
    bool running = false;
    for (int i = 0; i < 30; ++i) {
      Frame frame;
      frame.sequence = 12345;
      switch (random() % 6) {
        case 0:
          EXPECT_TRUE(driver.open());
          open = true;
          break;
        case 1:
          EXPECT_EQ(static_cast<bool>(driver.start()), open);
          running = open;
          break;
        case 2:
          EXPECT_EQ(static_cast<bool>(driver.read(frame)), running);
          if (!running) {
            EXPECT_EQ(frame.sequence, 12345U) << "modified without a reading";
          }
          break;
        case 3:
          EXPECT_EQ(static_cast<bool>(driver.write({0.001, true})), running);
          break;
        case 4:
          driver.stop();
          running = false;
          break;
        default:
          driver.close();
          open = running = false;
      }
    }
  }
}

TEST(MakeDriver, CreatesTheConfiguredDevice) {
  config::Rig rig = shipped();
  EXPECT_EQ(make_driver(rig)->description().name, "simulated rig");
  rig.driver = config::DriverKind::replay;
  rig.replay.speed = 0.0;
  Frame frame;
  frame.set(Channel::velocity, 1.0);
  const auto replay = make_driver(rig, {frame});
  ASSERT_TRUE(replay->open());
  ASSERT_TRUE(replay->start());
  Frame read;
  ASSERT_TRUE(replay->read(read));
  EXPECT_EQ(read, frame);
}

}  // namespace
}  // namespace stickslip::drivers
