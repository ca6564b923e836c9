#include "diagnosis/experiment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "physics/problem.h"
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

TEST(Experiment, IsRefusedWhenMostSamplesAreMissing) {
  auto recording = record(driven_mass(), 4.0);
  recording.frames.erase(recording.frames.begin() + 100, recording.frames.end() - 1);
  EXPECT_THAT(refusal(recording, driven_mass()), HasSubstr("three quarters"));
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

TEST(Experiment, IsRefusedBeforeAGridOfBillionsOfSamples) {
  auto recording = record(driven_mass(), 4.0);
  recording.frames.back().time_ns += 1'000'000'000'000'000'000;
  EXPECT_THAT(refusal(recording, driven_mass()), HasSubstr("three quarters"));
}

TEST(Experiment, IsRefusedIfTheTimeIsNotInSeconds) {
  auto recording = record(driven_mass(), 4.0);
  for (Frame& frame : recording.frames) frame.time_ns *= 1000;
  EXPECT_THAT(refusal(recording, driven_mass()), HasSubstr("Is time_s in seconds?"));
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
  recording.frames.erase(recording.frames.begin() + 800, recording.frames.begin() + 840);
  Experiment e = make_experiment(recording, driven_mass());
  EXPECT_EQ(e.samples, 1601U);
  EXPECT_EQ(e.valid[799], 1U);
  EXPECT_EQ(e.valid[800], 0U);
  EXPECT_EQ(e.valid[839], 0U);
  EXPECT_EQ(e.valid[840], 1U);
  cut_windows(e, driven_mass(), 0.4);
  ASSERT_FALSE(e.windows.empty());
  for (const Window& window : e.windows) {
    EXPECT_TRUE(window.end <= 840 || window.warm >= 840) << window.warm << " " << window.end;
  }
}

TEST(Windows, DoNotOverlapAndAThirdIsHeldOut) {
  Experiment e = make_experiment(record(driven_mass(), 40.0), driven_mass());
  cut_windows(e, driven_mass(), 0.4);
  ASSERT_GE(e.windows.size(), 90U);
  std::size_t held_out = 0;
  for (std::size_t w = 0; w < e.windows.size(); ++w) {
    const Window& window = e.windows[w];
    EXPECT_EQ(window.end - window.begin, 80U);
    EXPECT_LE(window.warm, window.begin);
    EXPECT_GE(window.begin, w > 0 ? e.windows[w - 1].end : e.usable_begin);
    EXPECT_LE(window.end, e.usable_end);
    if (window.held_out) ++held_out;
  }
  const double share = static_cast<double>(held_out) / static_cast<double>(e.windows.size());
  EXPECT_NEAR(share, 1.0 / 3.0, 0.06);
}

TEST(Experiment, CoarseStepsAreLongerForAFastResonance) {
  auto model = driven_mass();
  model.oscillator.stiffness_n_m = physics::Parameter{1.0e5, 1.0e3};  // 50 Hz
  const auto recording = record(model, 2.0);
  const Experiment fine = make_experiment(recording, model, Steps::fine);
  const Experiment coarse = make_experiment(recording, model, Steps::coarse);
  EXPECT_GT(fine.substeps, 2 * coarse.substeps - 1);
  EXPECT_EQ(fine.input.size(), (fine.samples - 1) * static_cast<std::size_t>(fine.substeps) + 1);
  EXPECT_EQ(coarse.input.size(),
            (coarse.samples - 1) * static_cast<std::size_t>(coarse.substeps) + 1);
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
