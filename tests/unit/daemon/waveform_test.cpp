// SPDX-License-Identifier: Apache-2.0
#include "daemon/waveform.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "config/demand.h"
#include "daemon/excitation.h"
#include "physics/problem.h"

namespace stickslip::daemon {
namespace {

using config::ExcitationKind;

constexpr double two_pi = 2.0 * std::numbers::pi;
constexpr double h = 1e-3;

config::Excitation of_kind(ExcitationKind kind, double amplitude) {
  config::Excitation out;
  out.enabled = true;
  out.kind = kind;
  out.amplitude = amplitude;
  return out;
}

Waveform made(const config::Excitation& settings) { return {settings, 0.01, {}}; }

/// Extremes of the signal and of its differences over a number of cycles.
config::Demand seen(Waveform& waveform, int cycles) {
  config::Demand out;
  double before = 0.0;
  double two_before = 0.0;
  for (int i = 0; i < cycles; ++i) {
    waveform.advance(h);
    const double now = waveform.value();
    out.displacement = std::max(out.displacement, std::abs(now));
    if (i > 0) out.velocity = std::max(out.velocity, std::abs(now - before) / h);
    if (i > 1) {
      out.acceleration =
          std::max(out.acceleration, std::abs(now - 2.0 * before + two_before) / (h * h));
    }
    two_before = before;
    before = now;
  }
  return out;
}

void expect_within(const config::Demand& seen, const config::Demand& bound) {
  EXPECT_LE(seen.displacement, bound.displacement * 1.0001);
  EXPECT_LE(seen.velocity, bound.velocity * 1.0001);
  EXPECT_LE(seen.acceleration, bound.acceleration * 1.0001);
}

TEST(Waveform, EveryKindStaysWithinItsDemandAndComesNearIt) {
  std::vector<config::Excitation> all;
  all.push_back(of_kind(ExcitationKind::modulated, 0.01));
  all.back().modulation_hz = 0.7;
  all.back().modulation_depth = 0.8;
  all.push_back(of_kind(ExcitationKind::by_hand, 0.012));
  all.back().by_hand = {0.002, 0.5, 9};
  all.push_back(of_kind(ExcitationKind::sweep, 0.006));
  all.back().sweep = {.from_hz = 2.0,
                      .to_hz = 6.0,
                      .duration_s = 20.0,
                      .scale = config::SweepScale::logarithmic,
                      .at_end = config::SweepEnd::repeat};
  all.push_back(of_kind(ExcitationKind::chirp, 0.006));
  all.back().sweep = {.from_hz = 6.0, .to_hz = 2.0, .duration_s = 5.0, .pause_s = 1.0};
  all.push_back(of_kind(ExcitationKind::multisine, 0.01));
  all.back().multisine = {{}, 12, 1.0, 6.5};
  all.push_back(of_kind(ExcitationKind::multisine, 0.0));
  all.back().multisine.lines = {{2.0, 0.003, 0.0}, {3.1, 0.002, 45.0}, {5.3, 0.001, -90.0}};
  for (const config::Excitation& settings : all) {
    SCOPED_TRACE(static_cast<int>(settings.kind));
    Waveform waveform = made(settings);
    const config::Demand bound = config::demand_of(settings);
    const config::Demand found = seen(waveform, 120'000);
    expect_within(found, bound);
    EXPECT_GE(found.displacement, 0.8 * bound.displacement);
    EXPECT_GE(found.velocity, 0.8 * bound.velocity);
    EXPECT_GE(found.acceleration, 0.7 * bound.acceleration);
  }
}

TEST(Waveform, TheHandIsSeededAndCoversItsRange) {
  config::Excitation settings = of_kind(ExcitationKind::by_hand, 0.012);
  settings.by_hand = {0.002, 0.2, 4};
  Waveform a = made(settings);
  Waveform b = made(settings);
  settings.by_hand.seed = 5;
  Waveform c = made(settings);
  double low = 1.0;
  double high = 0.0;
  bool differs = false;
  for (int i = 0; i < 600'000; ++i) {
    a.advance(h);
    b.advance(h);
    c.advance(h);
    ASSERT_EQ(a.value(), b.value());
    differs = differs || std::abs(a.value() - c.value()) > 1e-4;
    low = std::min(low, a.amplitude());
    high = std::max(high, a.amplitude());
  }
  EXPECT_TRUE(differs);
  EXPECT_GE(low, 0.002);
  EXPECT_LT(low, 0.003);
  EXPECT_LE(high, 0.012);
  EXPECT_GT(high, 0.011);
}

// The variation of the amplitude above the bandwidth is negligible.
TEST(Waveform, TheHandHasItsBandwidth) {
  config::Excitation settings = of_kind(ExcitationKind::by_hand, 0.01);
  settings.by_hand = {0.0, 0.25, 11};
  Waveform waveform = made(settings);
  constexpr int samples = 4096;
  constexpr double step_s = 0.1;
  std::vector<double> amplitude;
  double mean = 0.0;
  for (int i = 0; i < samples; ++i) {
    waveform.advance(step_s);
    amplitude.push_back(waveform.amplitude());
    mean += waveform.amplitude() / samples;
  }
  double below = 0.0;
  double above = 0.0;
  for (int k = 1; k < samples / 2; ++k) {
    double real = 0.0;
    double imaginary = 0.0;
    // Hann window against spectral leakage.
    for (int i = 0; i < samples; ++i) {
      const double window = 0.5 - 0.5 * std::cos(two_pi * i / samples);
      const double angle = two_pi * (static_cast<double>(k) * i / samples);
      real += window * (amplitude[static_cast<std::size_t>(i)] - mean) * std::cos(angle);
      imaginary += window * (amplitude[static_cast<std::size_t>(i)] - mean) * std::sin(angle);
    }
    const double frequency_hz = k / (samples * step_s);
    (frequency_hz <= settings.by_hand.bandwidth_hz ? below : above) +=
        real * real + imaginary * imaginary;
    if (frequency_hz > 4.0 * settings.by_hand.bandwidth_hz) break;
  }
  EXPECT_LT(above, 0.01 * (above + below));
}

TEST(Waveform, ALinearSweepIsTheSineOfItsIntegratedFrequency) {
  config::Excitation settings = of_kind(ExcitationKind::sweep, 0.005);
  settings.sweep = {.from_hz = 2.0, .to_hz = 6.0, .duration_s = 10.0};
  Waveform waveform = made(settings);
  for (int i = 1; i <= 15'000; ++i) {
    waveform.advance(h);
    const double t = i * h;
    const double turns = t <= 10.0 ? 2.0 * t + 0.2 * t * t : 40.0 + 6.0 * (t - 10.0);
    ASSERT_NEAR(waveform.value(), 0.005 * std::sin(two_pi * turns), 1e-9) << t;
  }
  EXPECT_DOUBLE_EQ(waveform.carrier_hz(), 6.0);
}

TEST(Waveform, ASweepEndsAsConfigured) {
  config::Excitation settings = of_kind(ExcitationKind::sweep, 0.005);
  const auto frequency_at = [&](double seconds) {
    Waveform waveform = made(settings);
    for (int i = 0; i < static_cast<int>(std::lround(seconds / h)); ++i) waveform.advance(h);
    return waveform.carrier_hz();
  };
  settings.sweep = {
      .from_hz = 2.0, .to_hz = 8.0, .duration_s = 10.0, .scale = config::SweepScale::logarithmic};
  EXPECT_NEAR(frequency_at(5.0), 4.0, 1e-9);
  EXPECT_NEAR(frequency_at(25.0), 8.0, 1e-9);
  settings.sweep.at_end = config::SweepEnd::back;
  EXPECT_NEAR(frequency_at(15.0), 4.0, 1e-9);
  EXPECT_NEAR(frequency_at(25.0), 2.0, 1e-9);
  settings.sweep.at_end = config::SweepEnd::repeat;
  EXPECT_NEAR(frequency_at(15.0), 4.0, 1e-9);
  EXPECT_NEAR(frequency_at(25.0), 4.0, 1e-9);
}

TEST(Waveform, BurstsOfAChirpAreIdenticalWithRestsBetween) {
  config::Excitation settings = of_kind(ExcitationKind::chirp, 0.005);
  settings.sweep = {
      .from_hz = 2.0, .to_hz = 6.0, .duration_s = 3.0, .pause_s = 1.0, .taper_s = 0.5};
  Waveform waveform = made(settings);
  std::vector<double> values;
  for (int i = 0; i < 12'000; ++i) {
    waveform.advance(h);
    values.push_back(waveform.value());
  }
  for (std::size_t i = 0; i + 4000 < values.size(); ++i) {
    ASSERT_NEAR(values[i], values[i + 4000], 1e-6) << i;
  }
  EXPECT_EQ(*std::max_element(values.begin() + 3001, values.begin() + 3990), 0.0);
  EXPECT_NEAR(*std::max_element(values.begin(), values.begin() + 3000), 0.005, 1e-5);
}

TEST(Waveform, MultisineHasItsConfiguredLines) {
  config::Excitation settings = of_kind(ExcitationKind::multisine, 0.0);
  settings.multisine.lines = {{2.0, 0.003, 30.0}, {5.0, 0.001, -90.0}};
  Waveform waveform = made(settings);
  for (int i = 1; i <= 3000; ++i) {
    waveform.advance(h);
    const double t = i * h;
    ASSERT_NEAR(waveform.value(),
                0.003 * std::sin(two_pi * 2.0 * t + two_pi / 12.0) +
                    0.001 * std::sin(two_pi * 5.0 * t - two_pi / 4.0),
                1e-12);
  }
}

TEST(SlewLimiter, MovesAtItsRateAndStopsWithoutOvershoot) {
  SlewLimiter limiter(0.002, 0.004);
  limiter.set(0.010);
  double before = limiter.value();
  double rate_before = 0.0;
  int cycles = 0;
  while (limiter.value() != 0.010) {
    limiter.advance(h);
    const double rate = (limiter.value() - before) / h;
    ASSERT_GE(rate, -1e-12);
    ASSERT_LE(rate, 0.004 * 1.000001);
    ASSERT_LE(std::abs(rate - rate_before), 0.004 / 0.25 * h * 1.001);
    ASSERT_LE(++cycles, 2500);
    before = limiter.value();
    rate_before = rate;
  }
  EXPECT_GE(cycles, 2000);
  for (int i = 0; i < 10; ++i) limiter.advance(h);
  EXPECT_EQ(limiter.value(), 0.010);
}

/// A temporary folder with a drive file.
class DriveInAFile : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "stickslip-XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  config::Excitation written(const std::string& text, config::DriveFileEnd at_end) const {
    std::ofstream(folder_ / "drive.csv") << text;
    config::Excitation out = of_kind(ExcitationKind::file, 0.0);
    out.file = {folder_ / "drive.csv", at_end};
    out.ramp_s = 0.1;
    return out;
  }
  static std::string sine(int samples, double period_s, double level) {
    std::string text = "time_s,base_displacement_m\n";
    for (int i = 0; i < samples; ++i) {
      text += std::to_string(i * period_s) + "," +
              std::to_string(level * std::sin(two_pi * 2.0 * period_s * i)) + "\n";
    }
    return text;
  }
  std::string refusal_of(const config::Excitation& settings, const DrivenRig& rig = usual) const {
    try {
      const Excitation excitation(settings, rig);
      return "";
    } catch (const InputError& error) {
      const std::string text = error.what();
      return text.substr(text.find("drive.csv"));
    }
  }
  static constexpr DrivenRig usual{{0.015, 0.5, 20.0}, Channel::base_displacement, h};
  std::filesystem::path folder_;
};

TEST_F(DriveInAFile, IsPlayedSmoothlyAndAgain) {
  // A hundredth of a second between samples; two whole periods.
  Excitation excitation(written(sine(101, 0.01, 0.01), config::DriveFileEnd::repeat), usual);
  excitation.start();
  for (int i = 1; i <= 5000; ++i) {
    const Drive drive = excitation.advance(h);
    ASSERT_EQ(drive.limited, Limit::none);
    if (i <= 100) continue;
    ASSERT_NEAR(drive.value, 0.01 * std::sin(two_pi * 2.0 * i * h), 2e-6) << i;
  }
}

TEST_F(DriveInAFile, RampsDownAtItsEndAndIsOff) {
  std::string text = "time_s,base_displacement_m\n";
  for (int i = 0; i <= 50; ++i) {
    const double t = i / 50.0;
    text += std::to_string(i * 0.02) + "," + std::to_string(0.005 * t * t * (3.0 - 2.0 * t)) + "\n";
  }
  Excitation excitation(written(text, config::DriveFileEnd::ramp_down), usual);
  excitation.start();
  double highest = 0.0;
  int cycles = 0;
  while (!excitation.is_off()) {
    highest = std::max(highest, excitation.advance(h).value);
    ASSERT_LT(++cycles, 1300);
  }
  EXPECT_NEAR(highest, 0.005, 1e-6);
  EXPECT_EQ(excitation.now().value, 0.0);
}

TEST_F(DriveInAFile, IsRefusedWithAReason) {
  using config::DriveFileEnd;
  EXPECT_EQ(refusal_of(written(sine(111, 0.01, 0.01), DriveFileEnd::repeat)).substr(0, 49),
            "drive.csv: begins at 0 and ends at 0.009511: a dr");
  EXPECT_THAT(refusal_of(written("time_s,displacement_m\n0,0\n1,0\n", DriveFileEnd::ramp_down)),
              testing::HasSubstr("has no base_displacement_m: expected the columns"));
  EXPECT_THAT(refusal_of(written("time_s,base_displacement_m,velocity_m_s\n0,0,0\n1,,0\n",
                                 DriveFileEnd::ramp_down)),
              testing::HasSubstr("has no base_displacement_m at 1 s: a drive has no gaps"));
  EXPECT_THAT(
      refusal_of(written("time_s,base_displacement_m\n0,0\n1,0\n", DriveFileEnd::ramp_down)),
      testing::HasSubstr("has 2 samples: a drive needs 4 or more"));
  EXPECT_THAT(refusal_of(written(sine(101, 0.01, 0.02), DriveFileEnd::ramp_down)),
              testing::HasSubstr("requires 0.02 m, limits.displacement_m allows 0.015"));
  const DrivenRig force{
      {5.0, 500.0, std::numeric_limits<double>::infinity()}, Channel::drive_force, h};
  EXPECT_THAT(refusal_of(written("time_s,drive_force_n\n0,0\n1,8\n2,8\n3,0\n4,0\n",
                                 DriveFileEnd::ramp_down),
                         force),
              testing::HasSubstr("N, limits.force_n allows 5"));
}

}  // namespace
}  // namespace stickslip::daemon
