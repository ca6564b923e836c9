// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/experiment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <random>

#include "physics/problem.h"
#include "physics/sensor_chain.h"
#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using test::driven_mass;
using test::record;
using ::testing::HasSubstr;

std::string refusal(const protocol::Recording& recording, const physics::Model& model) {
  try {
    make_experiment(recording, model);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

void remove_channel(protocol::Recording& recording, Channel channel) {
  const auto bit = static_cast<std::uint8_t>(1U << index_of(channel));
  recording.channels &= static_cast<std::uint8_t>(~bit);
  for (Frame& frame : recording.frames) frame.valid &= static_cast<std::uint8_t>(~bit);
}

TEST(Experiment, IsRefusedWithoutTheDrivingChannel) {
  auto recording = record(driven_mass(), 2.0);
  remove_channel(recording, Channel::drive_force);
  EXPECT_THAT(refusal(recording, driven_mass()),
              HasSubstr("bench.csv: lacks the column drive_force_n"));
}

TEST(Experiment, IsRefusedWithoutAPredictedChannel) {
  auto recording = record(driven_mass(), 2.0);
  remove_channel(recording, Channel::displacement);
  EXPECT_THAT(refusal(recording, driven_mass()), HasSubstr("lacks the column displacement_m"));
}

TEST(Experiment, IsRefusedWhenTooShort) {
  EXPECT_THAT(refusal(record(driven_mass(), 0.1), driven_mass()),
              HasSubstr("21 samples; at least 32 are needed"));
}

protocol::Recording with_load(double load_n) {
  auto recording = record(driven_mass(), 4.0);
  recording.channels |= static_cast<std::uint8_t>(1U << index_of(Channel::normal_load));
  for (Frame& frame : recording.frames) frame.set(Channel::normal_load, load_n);
  return recording;
}

TEST(Experiment, IsRefusedIfNoReadingOfAMeasuredLoadIsAboveZero) {
  auto model = driven_mass();
  model.normal_load = physics::NormalLoad{};
  model.normal_load->law = physics::NormalLoadLaw::measured;
  EXPECT_THAT(refusal(with_load(0.0), model), HasSubstr("bench.csv: has no normal_load_n above 0"));
  EXPECT_EQ(refusal(with_load(0.5), model), "");
}

TEST(Experiment, TakesTheDeclaredLoadForScaleIfTheMeasuredOneIsZero) {
  auto model = driven_mass();
  model.normal_load = physics::NormalLoad{};
  model.normal_load->load_n = {0.7};
  EXPECT_EQ(make_experiment(with_load(0.0), model).mean_load_n, 0.7);
  EXPECT_EQ(make_experiment(with_load(-0.2), model).mean_load_n, 0.7);
  EXPECT_NEAR(make_experiment(with_load(0.5), model).mean_load_n, 0.5, 1e-12);
}

void shift_from(protocol::Recording& recording, std::size_t first, std::int64_t by_ns) {
  for (std::size_t i = first; i < recording.frames.size(); ++i) {
    recording.frames[i].time_ns += by_ns;
  }
}

// A pause of two months in a recording of 8 s.
TEST(Experiment, AGapOfAnyLengthCostsNothing) {
  auto recording = record(driven_mass(), 8.0);
  shift_from(recording, 800, 5'000'000'000'000'000);
  Experiment e = make_experiment(recording, driven_mass());
  EXPECT_EQ(e.samples, 1602U);  // one stands for the gap
  EXPECT_NEAR(e.time_s(799), 3.995, 1.0e-9);
  EXPECT_NEAR(e.time_s(801), 5.0e6 + 4.0, 1.0e-6);
  EXPECT_NEAR(e.duration_s(), 5.0e6 + 8.005, 1.0e-6);
  cut_windows(e, driven_mass(), 0.4);
  EXPECT_EQ(e.windows.size(), 20U);
  for (const Window& window : e.windows) EXPECT_TRUE(window.end <= 800 || window.warm >= 801);
}

TEST(Experiment, IsRefusedIfTheTimeIsInMilliseconds) {
  auto recording = record(driven_mass(), 4.0);
  for (Frame& frame : recording.frames) frame.time_ns *= 1000;
  EXPECT_EQ(refusal(recording, driven_mass()),
            "bench.csv: has a sample every 5 s, but the model's natural period is 0.5 s: nothing "
            "between two samples can be compared. Expected at least 3 samples in each; time_s "
            "looks like milliseconds; as milliseconds there would be a sample every 0.005 s");
}

TEST(Experiment, IsRefusedIfTheTimeIsAThousandTimesTooShort) {
  auto recording = record(driven_mass(), 4.0);
  for (Frame& frame : recording.frames) frame.time_ns /= 1000;
  EXPECT_THAT(refusal(recording, driven_mass()), HasSubstr("too small by a factor of 1000,"));
}

// A base-excited rig behind filters, whose inputs are reconstructed over a long time.
physics::Model shaken_mass() {
  auto model = driven_mass();
  model.oscillator.excitation = physics::Excitation::base;
  model.sensors[index_of(Channel::base_displacement)].noise_std = 1.0e-5;
  model.sensors[index_of(Channel::base_displacement)].filters = {
      {physics::FilterKind::butterworth_lowpass, 4, 25.0}};
  return model;
}

// The base as its filtered sensor reads it in steady state; `at` gives the time of each row.
protocol::Recording shaken(const std::function<double(int)>& at, int rows,
                           std::int32_t age_us = 0) {
  const physics::FilterChain chain(shaken_mass().sensors[4].filters, 0.005);
  protocol::Recording recording;
  recording.source = "shaken.csv";
  for (int k = 0; k < rows; ++k) {
    Frame frame;
    frame.time_ns = std::llround(1.0e9 * at(k));
    double base = 0.0;
    for (const double hz : {1.3, 2.2, 3.1}) {
      const auto response = chain.response(hz);
      const double turn = 2.0 * std::numbers::pi * hz * (frame.time_s() - 1.0e-6 * age_us);
      base += 0.004 * std::abs(response) * std::sin(turn + std::arg(response));
    }
    frame.set(Channel::base_displacement, base);
    frame.age_us[index_of(Channel::base_displacement)] = age_us;
    frame.set(Channel::displacement, 0.01 * std::sin(12.0 * frame.time_s()));
    recording.channels |= frame.valid;
    recording.frames.push_back(frame);
  }
  return recording;
}

double base_acceleration_m_s2(double time_s) {
  double sum = 0.0;
  for (const double hz : {1.3, 2.2, 3.1}) {
    const double omega = 2.0 * std::numbers::pi * hz;
    sum -= 0.004 * omega * omega * std::sin(omega * time_s);
  }
  return sum;
}

// Root mean square of the error of the base's acceleration in what is usable, over its amplitude.
double relative_error_of_base(const Experiment& e) {
  double square = 0.0;
  double count = 0.0;
  for (const Segment& segment : e.segments) {
    for (std::size_t k = segment.usable_begin; k < segment.usable_end; ++k, ++count) {
      const double found = e.input[k * static_cast<std::size_t>(e.substeps)].base_acceleration_m_s2;
      square += std::pow(found - base_acceleration_m_s2(e.time_s(k)), 2);
    }
  }
  return std::sqrt(square / count) / 2.0;
}

TEST(Experiment, NothingIsReconstructedAcrossAGap) {
  auto recording = shaken([](int k) { return 0.005 * k; }, 8000);
  const double whole = relative_error_of_base(make_experiment(recording, shaken_mass()));
  recording.frames.erase(recording.frames.begin() + 3000, recording.frames.begin() + 4000);
  recording.frames.erase(recording.frames.begin() + 5000, recording.frames.begin() + 5012);
  const Experiment e = make_experiment(recording, shaken_mass());
  ASSERT_EQ(e.segments.size(), 3U);
  EXPECT_NEAR(e.time_s(e.segments[1].begin), 20.0, 1.0e-9);
  EXPECT_EQ(e.segments[1].usable_begin, e.segments[1].begin + 70);
  EXPECT_LT(whole, 0.02);
  EXPECT_LT(relative_error_of_base(e), 0.02);
}

// An input that is inaccurate near a gap would move the rig before the readings are compared.
TEST(Windows, AreIntegratedFromWhereInputsAreAccurate) {
  auto recording = shaken([](int k) { return 0.005 * k; }, 8000);
  recording.frames.erase(recording.frames.begin() + 3000, recording.frames.begin() + 4000);
  physics::Model late = shaken_mass();
  late.sensors[0].delay_s = physics::Parameter{0.0, 1.0e-3};
  Experiment e = make_experiment(recording, late);
  cut_windows(e, late, 0.4);
  ASSERT_GT(e.windows.size(), 60U);
  for (const Window& window : e.windows) {
    EXPECT_LT(window.warm, window.begin);
    EXPECT_GE(window.warm, e.segment_of(window.begin).usable_begin);
  }
}

TEST(Experiment, InputsAreThoseAtTheInstantsWhateverTheirTimesOfMeasurement) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> jitter(-0.3, 0.3);
  const auto jittered = [&](int k) { return 0.005 * (k + jitter(random)); };
  EXPECT_LT(relative_error_of_base(make_experiment(shaken(jittered, 8000), shaken_mass())), 0.02);
  const auto aged = shaken([](int k) { return 0.005 * k; }, 8000, 3000);
  EXPECT_LT(relative_error_of_base(make_experiment(aged, shaken_mass())), 0.02);
  auto slow = shaken([](int k) { return 0.005 * k; }, 8000);
  for (std::size_t i = 0; i < slow.frames.size(); ++i) {
    if (i % 4 != 0) slow.frames[i].invalidate(Channel::base_displacement);
  }
  EXPECT_LT(relative_error_of_base(make_experiment(slow, shaken_mass())), 0.02);
}

TEST(Experiment, KeepsTheTimesAtWhichReadingsWereTaken) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> jitter(-0.3, 0.3);
  auto recording = record(driven_mass(), 20.0);
  EXPECT_TRUE(make_experiment(recording, driven_mass()).measured_after_s.empty());
  std::vector<std::int64_t> late_ns;
  for (Frame& frame : recording.frames) {
    late_ns.push_back(std::llround(5.0e6 * jitter(random)));
    frame.time_ns += late_ns.back();
    frame.age_us[index_of(Channel::displacement)] = 400;
  }
  const Experiment e = make_experiment(recording, driven_mass());
  ASSERT_EQ(e.measured_after_s.size(), e.samples);
  for (std::size_t k = 0; k < e.samples; ++k) {
    ASSERT_NEAR(e.time_s(k) + static_cast<double>(e.measured_after_s[k][0]),
                0.005 * static_cast<double>(k) + 1.0e-9 * static_cast<double>(late_ns[k]) - 4.0e-4,
                2.0e-6);
  }
}

// Rounded to milliseconds, no time says more than the clock that was fitted to all of them.
TEST(Experiment, TakesTheRoundingOfTheTimesForNoJitter) {
  auto recording = record(driven_mass(), 20.0);
  for (std::size_t k = 0; k < recording.frames.size(); ++k) {
    const double time_s = static_cast<double>(k) / 199.3;
    recording.frames[k].time_ns = 1'000'000 * std::llround(1000.0 * time_s);
  }
  const Experiment e = make_experiment(recording, driven_mass());
  EXPECT_TRUE(e.measured_after_s.empty());
  EXPECT_NEAR(e.period_s, 1.0 / 199.3, 1.0e-8);
}

TEST(Experiment, AChannelOfAnEighthOfTheRateHasTheNoiseOfItsReadings) {
  auto model = driven_mass();
  model.sensors[0].noise_std.reset();
  std::mt19937_64 random(9);
  std::normal_distribution<double> noise(0.0, 5.0e-4);
  auto recording = record(driven_mass(), 100.0);
  for (std::size_t i = 0; i < recording.frames.size(); ++i) {
    Frame& frame = recording.frames[i];
    frame.set(Channel::displacement, frame[Channel::displacement] + noise(random));
    if (i % 4 != 0) frame.invalidate(Channel::displacement);
  }
  const Experiment e = make_experiment(recording, model);
  EXPECT_NEAR(e.noise_std[0], 5.0e-4, 1.0e-4);
  EXPECT_EQ(e.valid[400], 1U);
  EXPECT_EQ(e.valid[401], 0U);
  EXPECT_EQ(e.segments.size(), 1U);
}

TEST(Experiment, ReplacesDeclaredNoiseThatIsTooSmall) {
  auto model = driven_mass();
  const auto recording = record(model, 8.0);
  model.sensors[0].noise_std = 1.0e-5;
  const Experiment doubled = make_experiment(recording, model);
  EXPECT_NEAR(doubled.noise_above_declared[0], 2.0, 0.15);
  EXPECT_NEAR(doubled.noise_std[0], 2.0e-5, 0.15e-5);
  EXPECT_FALSE(doubled.noise_declared[0]);
  model.sensors[0].noise_std = 3.0e-5;  // of which white noise may be a part
  EXPECT_EQ(make_experiment(recording, model).noise_std[0], 3.0e-5);
}

TEST(Experiment, KeepsTheDeclaredNoiseOfSignalsThatMoveBetweenReadings) {
  auto model = driven_mass();
  auto recording = record(model, 40.0, 1, false);
  auto& frames = recording.frames;
  for (std::size_t k = 0; 16 * k < frames.size(); ++k) frames[k] = frames[16 * k];
  frames.resize(frames.size() / 16);
  EXPECT_EQ(make_experiment(recording, model).noise_std[0], 2.0e-5);
}

TEST(Experiment, EstimatesNoiseThatIsNotDeclared) {
  auto model = driven_mass();
  const auto recording = record(model, 8.0);
  const Experiment declared = make_experiment(recording, model);
  EXPECT_TRUE(declared.noise_declared[0]);
  EXPECT_EQ(declared.noise_std[0], 2.0e-5);
  model.sensors[0].noise_std.reset();
  const Experiment estimated = make_experiment(recording, model);
  EXPECT_FALSE(estimated.noise_declared[0]);
  // At least a thousandth of the motion: no model is more accurate.
  EXPECT_GE(estimated.noise_std[0], 0.99e-3 * estimated.channel_std[0]);
}

TEST(Experiment, MissingSamplesAreNeitherComparedNorPartOfAWindow) {
  auto recording = record(driven_mass(), 8.0);
  recording.frames.erase(recording.frames.begin() + 800, recording.frames.begin() + 814);
  Experiment e = make_experiment(recording, driven_mass());
  EXPECT_EQ(e.samples, 1601U);
  EXPECT_EQ(e.valid[799], 1U);
  EXPECT_EQ(e.valid[800], 0U);
  EXPECT_EQ(e.valid[813], 0U);
  EXPECT_EQ(e.valid[814], 1U);
  cut_windows(e, driven_mass(), 0.4);
  ASSERT_FALSE(e.windows.empty());
  for (const Window& window : e.windows) {
    EXPECT_TRUE(window.end <= 800 || window.warm >= 814) << window.warm << " " << window.end;
  }
}

// One row in fifty is missing, as over a radio link: windows remain, and what drives the model is
// restored where it is missing.
TEST(Experiment, FewMissingSamplesAreBridged) {
  auto recording = record(driven_mass(), 20.0);
  const Experiment whole = make_experiment(recording, driven_mass());
  for (std::size_t i = recording.frames.size() - 10; i > 0; i -= std::min<std::size_t>(i, 50)) {
    recording.frames.erase(recording.frames.begin() + static_cast<std::ptrdiff_t>(i));
  }
  const Experiment e = make_experiment(recording, driven_mass());
  ASSERT_EQ(e.segments.size(), 1U);
  ASSERT_EQ(e.input.size(), whole.input.size());
  for (std::size_t i = 0; i < e.input.size(); ++i) {
    EXPECT_NEAR(e.input[i].drive_force_n, whole.input[i].drive_force_n, 1.0e-3);
  }
}

TEST(Windows, DoNotOverlapAndHaveThreeUses) {
  Experiment e = make_experiment(record(driven_mass(), 40.0), driven_mass());
  cut_windows(e, driven_mass(), 0.4);
  ASSERT_GE(e.windows.size(), 90U);
  std::map<Use, double> share;
  for (std::size_t w = 0; w < e.windows.size(); ++w) {
    const Window& window = e.windows[w];
    EXPECT_EQ(window.end - window.begin, 80U);
    EXPECT_LE(window.warm, window.begin);
    EXPECT_GE(window.begin, w > 0 ? e.windows[w - 1].end : e.usable_begin);
    EXPECT_LE(window.end, e.usable_end);
    share[window.use] += 1.0 / static_cast<double>(e.windows.size());
  }
  EXPECT_NEAR(share[Use::fit], 8.0 / 12.0, 0.06);
  EXPECT_NEAR(share[Use::select], 3.0 / 12.0, 0.06);
  EXPECT_NEAR(share[Use::report], 1.0 / 12.0, 0.04);
}

TEST(Experiment, CoarseStepsAreLongerForAFastResonance) {
  auto model = driven_mass();
  model.oscillator.stiffness_n_m = physics::Parameter{1.0e5, 1.0e3};  // 50 Hz
  const auto recording = record(model, 2.0);
  const Experiment e = make_experiment(recording, model);
  EXPECT_GE(e.substeps, 2 * e.coarse_substeps);
  EXPECT_EQ(e.substeps % e.coarse_substeps, 0);
  EXPECT_EQ(e.input.size(), (e.samples - 1) * static_cast<std::size_t>(e.substeps) + 1);
}

TEST(Horizon, IsOnePeriodOfTheRigWithinBounds) {
  const Experiment e = make_experiment(record(driven_mass(), 40.0), driven_mass());
  EXPECT_NEAR(default_horizon_s(driven_mass(), e), 0.5, 0.01);
  auto slow = driven_mass();
  slow.oscillator.stiffness_n_m = physics::Parameter{1.0};
  EXPECT_EQ(default_horizon_s(slow, e), 1.5);
  auto fast = driven_mass();
  fast.oscillator.stiffness_n_m = physics::Parameter{1.0e5};
  EXPECT_EQ(default_horizon_s(fast, e), 0.4);
}

}  // namespace
}  // namespace stickslip::diagnosis
