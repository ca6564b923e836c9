// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/channel_faults.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <tuple>
#include <utility>

#include "diagnosis/diagnosis.h"
#include "physics/problem.h"
#include "physics/simulator.h"

namespace stickslip::diagnosis {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

// A base-excited rig with every channel but the drive force, driven well below its noise floor's
// reach: 60 g at 2.4 Hz, rubbing.
physics::Model rubbing_mass() {
  physics::Model model;
  model.oscillator.mass_kg = {0.06};
  model.oscillator.natural_frequency_hz = physics::Parameter{2.4, 0.05};
  model.oscillator.damping_ratio = physics::Parameter{0.015, 0.005};
  model.normal_load = physics::NormalLoad{physics::NormalLoadLaw::constant, {0.15, 0.01}, {}};
  model.friction = {physics::FrictionLaw::coulomb, {0.8, 0.1}, {0.0025}, {}};
  const auto noise = [&model](Channel channel, double std) {
    model.sensors[index_of(channel)].noise_std = std;
  };
  noise(Channel::displacement, 2.0e-5);
  noise(Channel::velocity, 5.0e-4);
  noise(Channel::friction_force, 1.0e-3);
  noise(Channel::normal_load, 1.0e-3);
  noise(Channel::base_displacement, 2.0e-5);
  return model;
}

physics::Input base_at(double t) {
  physics::Input input;
  for (const auto& [hz, amplitude_m, phase] :
       {std::tuple{1.7, 0.012, 0.0}, std::tuple{2.9, 0.006, 1.0}, std::tuple{4.1, 0.003, 2.0}}) {
    const double omega = 2.0 * std::numbers::pi * hz;
    input.base_displacement_m += amplitude_m * std::sin(omega * t + phase);
    input.base_acceleration_m_s2 -= omega * omega * amplitude_m * std::sin(omega * t + phase);
  }
  return input;
}

// 20 s at 500 Hz.
protocol::Recording recorded() {
  static const protocol::Recording once = [] {
    physics::SimulationOptions options;
    options.step_s = 5.0e-4;
    physics::RigSimulator rig(rubbing_mass(), options);
    protocol::Recording recording;
    recording.source = "bench.csv";
    for (int k = 0; k < 10000; ++k) {
      for (int part = 1; k > 0 && part <= 4; ++part) {
        rig.advance(5.0e-4, base_at((k - 1) / 500.0 + part * 5.0e-4));
      }
      if (k == 0) rig.set_input(base_at(0.0));
      Frame frame = rig.read();
      frame.time_ns = k * 2'000'000LL;
      frame.invalidate(Channel::drive_force);
      recording.channels |= frame.valid;
      recording.frames.push_back(frame);
    }
    return recording;
  }();
  return once;
}

protocol::Recording times(Channel channel, double factor) {
  auto recording = recorded();
  for (Frame& frame : recording.frames) frame.set(channel, factor * frame[channel]);
  return recording;
}

protocol::Recording exchanged(Channel one, Channel other) {
  auto recording = recorded();
  for (Frame& frame : recording.frames) {
    std::swap(frame.value[index_of(one)], frame.value[index_of(other)]);
  }
  return recording;
}

// The channel keeps its value from 8 s on.
protocol::Recording stuck(Channel channel, double until_s) {
  auto recording = recorded();
  const double value = recording.frames[4000][channel];
  for (Frame& frame : recording.frames) {
    if (frame.time_s() >= 8.0 && frame.time_s() < until_s) frame.set(channel, value);
  }
  return recording;
}

std::string fault_of(const protocol::Recording& recording) {
  return channel_fault(recording, rubbing_mass()).value_or("none");
}

constexpr std::array recorded_channels = {Channel::displacement, Channel::velocity,
                                          Channel::friction_force, Channel::normal_load,
                                          Channel::base_displacement};

TEST(ChannelFaults, AGoodRecordingHasNone) { EXPECT_EQ(fault_of(recorded()), "none"); }

TEST(ChannelFaults, SmallErrorsOfASensorAreNone) {
  for (const Channel channel : recorded_channels) {
    EXPECT_EQ(fault_of(times(channel, 1.3)), "none") << info(channel).stem;
    EXPECT_EQ(fault_of(times(channel, 0.7)), "none") << info(channel).stem;
  }
}

TEST(ChannelFaults, AWrongModelIsNone) {
  physics::Model model = rubbing_mass();
  model.oscillator.natural_frequency_hz = physics::Parameter{3.5};
  model.friction = {};
  EXPECT_EQ(channel_fault(recorded(), model), std::nullopt);
}

TEST(ChannelFaults, DeadChannels) {
  for (const Channel channel :
       {Channel::displacement, Channel::velocity, Channel::friction_force}) {
    EXPECT_THAT(fault_of(times(channel, 0.0)),
                AllOf(HasSubstr(std::string(info(channel).column) + " is 0"), HasSubstr("dead")));
  }
  EXPECT_THAT(fault_of(times(Channel::normal_load, 0.0)), HasSubstr("measures no load"));
}

TEST(ChannelFaults, ChannelsStuckForFiveSecondsWhileTheMassMoves) {
  for (const Channel channel :
       {Channel::displacement, Channel::velocity, Channel::friction_force, Channel::normal_load}) {
    EXPECT_THAT(fault_of(stuck(channel, 14.0)),
                AllOf(HasSubstr(std::string(info(channel).column)), HasSubstr("from 8 s to 14 s"),
                      HasSubstr("stuck")));
    EXPECT_EQ(fault_of(stuck(channel, 10.0)), "none");
  }
}

TEST(ChannelFaults, AMassThatSticksIsNone) {
  auto recording = recorded();
  for (Frame& frame : recording.frames) {
    if (frame.time_s() < 8.0) continue;
    frame.set(Channel::displacement, 0.001);
    frame.set(Channel::velocity, 0.0);
    frame.set(Channel::base_displacement, 0.0);
    frame.set(Channel::friction_force, 0.02);
  }
  EXPECT_EQ(fault_of(recording), "none");
}

TEST(ChannelFaults, ReversedSigns) {
  EXPECT_THAT(fault_of(times(Channel::velocity, -1.0)), HasSubstr("with the sign reversed"));
  EXPECT_THAT(fault_of(times(Channel::displacement, -1.0)), HasSubstr("with the sign reversed"));
  EXPECT_THAT(fault_of(times(Channel::normal_load, -1.0)), HasSubstr("its sign is reversed"));
  EXPECT_THAT(fault_of(times(Channel::friction_force, -1.0)), HasSubstr("friction_force_n"));
  EXPECT_THAT(fault_of(times(Channel::base_displacement, -1.0)),
              HasSubstr("base_displacement_m has its sign reversed"));
}

TEST(ChannelFaults, FactorsOfAThousand) {
  EXPECT_THAT(fault_of(times(Channel::displacement, 1000.0)), HasSubstr("displacement_m=mm"));
  EXPECT_THAT(fault_of(times(Channel::velocity, 1000.0)), HasSubstr("velocity_m_s=mm/s"));
  EXPECT_THAT(fault_of(times(Channel::normal_load, 1000.0)), HasSubstr("normal_load_n=mN"));
  EXPECT_THAT(fault_of(times(Channel::friction_force, 1000.0)), HasSubstr("friction_force_n=mN"));
  EXPECT_THAT(fault_of(times(Channel::base_displacement, 1000.0)),
              HasSubstr("base_displacement_m=mm"));
}

// The other forces balance by themselves, and a small factor would remove the noise.
TEST(ChannelFaults, ANoisyDisplacementHasNoOtherUnit) {
  auto recording = recorded();
  for (std::size_t i = 0; i < recording.frames.size(); ++i) {
    Frame& frame = recording.frames[i];
    const double noise_m = i / 5 % 2 == 0 ? 2.0e-3 : -2.0e-3;
    frame.invalidate(Channel::velocity);
    frame.set(Channel::friction_force, -0.06 * base_at(frame.time_s()).base_acceleration_m_s2);
    frame.set(Channel::displacement, frame[Channel::displacement] + noise_m);
  }
  recording.channels = recording.frames.front().valid;
  EXPECT_EQ(fault_of(recording), "none");
}

TEST(ChannelFaults, ExchangedColumns) {
  using enum Channel;
  for (const auto& [one, other] :
       {std::pair{displacement, velocity}, std::pair{displacement, base_displacement},
        std::pair{velocity, friction_force}, std::pair{friction_force, normal_load}}) {
    EXPECT_THAT(fault_of(exchanged(one, other)), HasSubstr("exchange"))
        << info(one).stem << " and " << info(other).stem;
  }
}

TEST(ChannelFaults, EndADiagnosisBeforeAnythingIsFitted) {
  try {
    diagnose({times(Channel::velocity, -1.0)}, rubbing_mass());
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("bench.csv: velocity_m_s is the rate of displacement_m"));
  }
}

}  // namespace
}  // namespace stickslip::diagnosis
