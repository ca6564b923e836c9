// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/integrity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "physics/sensor_chain.h"

namespace stickslip::diagnosis {
namespace {

using std::numbers::pi;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double rate_hz = 500.0;

double motion_m(double t) {
  return 0.01 * std::sin(2.0 * pi * 2.3 * t) + 0.004 * std::sin(2.0 * pi * 3.71 * t + 0.4);
}

double speed_m_s(double t) {
  return 0.01 * 2.0 * pi * 2.3 * std::cos(2.0 * pi * 2.3 * t) +
         0.004 * 2.0 * pi * 3.71 * std::cos(2.0 * pi * 3.71 * t + 0.4);
}

// 20 s of two tones, quantised and noisy, with a velocity delayed by `late_s`.
protocol::Recording two_tones(double late_s = 0.0) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  protocol::Recording recording;
  recording.source = "tones.csv";
  for (int k = 0; k < 10000; ++k) {
    const double t = k / rate_hz;
    Frame frame;
    frame.time_ns = std::llround(t * 1.0e9);
    const auto read = [](double value, double step) { return step * std::round(value / step); };
    frame.set(Channel::displacement, read(motion_m(t) + 2.0e-5 * normal(random), 1.0e-6));
    frame.set(Channel::velocity, read(speed_m_s(t - late_s) + 5.0e-4 * normal(random), 1.0e-5));
    recording.channels |= frame.valid;
    recording.frames.push_back(frame);
  }
  return recording;
}

TEST(Integrity, CleanRecordingHasNoRemarks) {
  const Integrity found = integrity_of(two_tones(), physics::Model{});
  EXPECT_THAT(found.remarks, IsEmpty());
  EXPECT_EQ(found.frames, 10000u);
  EXPECT_EQ(found.lost, 0u);
  EXPECT_NEAR(found.rate_hz, 500.0, 1.0e-6);
  EXPECT_NEAR(found.duration_s, 20.0, 1.0e-6);
  ASSERT_EQ(found.channels.size(), 2u);
  EXPECT_NEAR(found.channels[0].step, 1.0e-6, 1.0e-12);
  EXPECT_FALSE(found.channels[0].mains);
}

TEST(Integrity, CountsMissingSamplesAndTheLongestGap) {
  auto recording = two_tones();
  recording.frames.erase(recording.frames.begin() + 500, recording.frames.begin() + 510);
  recording.frames.erase(recording.frames.begin() + 3000);
  const Integrity found = integrity_of(recording, physics::Model{});
  EXPECT_EQ(found.lost, 11u);
  EXPECT_NEAR(found.longest_gap_s, 11.0 / rate_hz, 1.0e-9);
  EXPECT_THAT(found.remarks,
              ElementsAre("11 of 10000 samples are missing; the longest gap is 0.022 s"));
}

TEST(Integrity, FramesThatWereLeftOutAreNotLost) {
  auto recording = two_tones();
  recording.frames.erase(recording.frames.begin() + 500, recording.frames.begin() + 4500);
  recording.left_out = 4000;
  recording.after_left_out = {500};
  const Integrity found = integrity_of(recording, physics::Model{});
  EXPECT_EQ(found.lost, 0u);
  EXPECT_EQ(found.longest_gap_s, 0.0);
  EXPECT_THAT(found.remarks,
              ElementsAre("4000 frames of 10000 were left out, more than one diagnosis can take; "
                          "those taken are stretches spread over the recording"));
}

TEST(Integrity, FindsClippedReadings) {
  auto recording = two_tones();
  for (Frame& frame : recording.frames) {
    frame.set(Channel::displacement, std::min(frame[Channel::displacement], 0.0095));
  }
  const Integrity found = integrity_of(recording, physics::Model{});
  EXPECT_EQ(found.channels[0].highest, 0.0095);
  EXPECT_GT(found.channels[0].at_high_rail, 500u);
  EXPECT_EQ(found.channels[0].at_low_rail, 0u);
  ASSERT_FALSE(found.remarks.empty());
  EXPECT_THAT(found.remarks[0], HasSubstr("displacement rests at its lowest"));
}

TEST(Integrity, FindsAMainsLineOfHalfTheNoise) {
  auto recording = two_tones();
  for (Frame& frame : recording.frames) {
    frame.set(Channel::displacement,
              frame[Channel::displacement] + 1.0e-5 * std::sin(2.0 * pi * 50.03 * frame.time_s()));
  }
  const Integrity found = integrity_of(recording, physics::Model{});
  ASSERT_TRUE(found.channels[0].mains);
  EXPECT_NEAR(found.channels[0].mains->frequency_hz, 50.03, 0.03);
  EXPECT_NEAR(found.channels[0].mains->amplitude, 1.0e-5, 2.0e-6);
  EXPECT_FALSE(found.channels[1].mains);
  ASSERT_EQ(found.remarks.size(), 1u);
  EXPECT_THAT(found.remarks[0], HasSubstr("look for a ground loop"));
}

// Two tones and a line in the displacement.
protocol::Recording with_line(double frequency_hz, double amplitude_m, std::size_t every = 1) {
  auto recording = two_tones();
  protocol::Recording out = recording;
  out.frames.clear();
  for (std::size_t k = 0; k < recording.frames.size(); k += every) {
    Frame frame = recording.frames[k];
    frame.set(Channel::displacement,
              frame[Channel::displacement] +
                  amplitude_m * std::sin(2.0 * pi * frequency_hz * frame.time_s()));
    out.frames.push_back(frame);
  }
  return out;
}

TEST(Integrity, ALineIsMainsOnlyWhereItIsOneAndMatters) {
  EXPECT_TRUE(integrity_of(with_line(60.15, 1.0e-5), physics::Model{}).channels[0].mains);
  EXPECT_FALSE(integrity_of(with_line(60.5, 1.0e-5), physics::Model{}).channels[0].mains);
  EXPECT_FALSE(integrity_of(with_line(50.0, 3.0e-6), physics::Model{}).channels[0].mains);
}

TEST(Integrity, AToneOfAPeriodicMotionIsNotMains) {
  auto recording = two_tones();
  for (Frame& frame : recording.frames) {
    double x = frame[Channel::displacement];
    for (int n = 20; n <= 40; ++n) x += 1.0e-4 * std::sin(2.0 * pi * 1.667 * n * frame.time_s());
    frame.set(Channel::displacement, x);
  }
  EXPECT_FALSE(integrity_of(recording, physics::Model{}).channels[0].mains);
}

TEST(Integrity, NamesTheMainsFrequencyBehindAnAlias) {
  const Integrity found = integrity_of(with_line(50.0, 2.0e-5, 7), physics::Model{});
  ASSERT_TRUE(found.channels[0].mains);  // at 71.4 Hz
  EXPECT_NEAR(found.channels[0].mains->frequency_hz, rate_hz / 7.0 - 50.0, 0.05);
  EXPECT_EQ(found.channels[0].mains_hz, 50.0);
  EXPECT_THAT(found.remarks[0], HasSubstr("the alias of 50 Hz at this sampling rate"));
}

TEST(Integrity, AHarmonicOfTheDriveIsNotMains) {
  auto recording = with_line(50.0, 1.0e-4);
  for (Frame& frame : recording.frames) {
    frame.set(Channel::drive_force, std::sin(2.0 * pi * frame.time_s() * 50.0 / 3.0));
    recording.channels |= frame.valid;
  }
  EXPECT_FALSE(integrity_of(recording, physics::Model{}).channels[0].mains);
}

TEST(Integrity, MeasuresTheDelayOfTheVelocity) {
  for (const double late_s : {4.0e-4, -1.5e-3}) {
    const Integrity found = integrity_of(two_tones(late_s), physics::Model{});
    ASSERT_TRUE(found.velocity_delay_s);
    EXPECT_NEAR(*found.velocity_delay_s, late_s, 4.0 * found.velocity_delay_error_s);
    EXPECT_LT(found.velocity_delay_error_s, 5.0e-5);
    ASSERT_EQ(found.remarks.size(), 1u);
    EXPECT_THAT(found.remarks[0], HasSubstr(late_s > 0.0 ? "lags" : "leads"));
  }
}

TEST(Integrity, TakesADeclaredRollOffIntoAccount) {
  physics::Model model;
  model.sensors[index_of(Channel::velocity)].filters = {
      {physics::FilterKind::first_order_lowpass, 1, 40.0}};
  // A first-order roll-off delays slow tones by 1 / (2 pi cut-off).
  const Integrity found = integrity_of(two_tones(1.0 / (2.0 * pi * 40.0)), model);
  EXPECT_NEAR(*found.velocity_delay_s, 0.0, 3.0e-5);
}

TEST(Integrity, RemarksOnCoarseAndConstantChannels) {
  auto recording = two_tones();
  for (Frame& frame : recording.frames) {
    frame.set(Channel::displacement, 1.0e-4 * std::round(frame[Channel::displacement] / 1.0e-4));
    frame.set(Channel::normal_load, 0.15);
    recording.channels |= frame.valid;
  }
  const Integrity found = integrity_of(recording, physics::Model{});
  ASSERT_EQ(found.remarks.size(), 2u);
  EXPECT_THAT(found.remarks[0], HasSubstr("displacement spans only 2"));
  EXPECT_EQ(found.remarks[1], "normal_load never changes: is it connected?");
}

}  // namespace
}  // namespace stickslip::diagnosis
