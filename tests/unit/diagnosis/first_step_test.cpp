// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/first_step.h"

#include <gtest/gtest.h>

#include "physics/catalogue.h"
#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using test::driven_mass;
using test::with_term;

// The declared rig fitted to a recording of `actual`.
struct Calibrated {
  std::vector<Experiment> experiments;
  Task task;
  FittedCandidate base;

  explicit Calibrated(const physics::Model& actual)
      : experiments{test::experiment_of(test::record(actual, 24.0), driven_mass())},
        task(test::all_windows(experiments)) {
    base.hypothesis.emplace(driven_mass());
    base.fitted = fit(task, *base.hypothesis, {0.0, 0.0}, initial_states(task, *base.hypothesis));
  }

  std::optional<FittedCandidate> after(const char* id,
                                       const std::vector<std::vector<double>>& starts) const {
    const FirstSteps steps(task, base, base.fitted.state);
    auto step = steps.after({physics::find_effect(id), {}}, starts, {});
    if (!step) return std::nullopt;
    return std::move(step->candidate);
  }
  // The cost of a fit that goes on from there.
  double best_cost(const FittedCandidate& from) const {
    return fit(task, *from.hypothesis, from.fitted.z, from.fitted.state).cost;
  }
};

constexpr double hum_hz = 3.3;

physics::Model shaken(double amplitude_n, double phase_rad) {
  return with_term(
      driven_mass(), "ambient_vibration",
      {{"frequency_hz", {hum_hz}}, {"amplitude_n", {amplitude_n}}, {"phase_rad", {phase_rad}}});
}

TEST(FirstStep, HasTheSizeOfTheEffectFromAStartWithoutIt) {
  const Calibrated recording(with_term(driven_mass(), "cubic_stiffness", {{"k3_n_m3", {1.0}}}));
  const auto stepped = recording.after("cubic_stiffness", {{0.0}});
  ASSERT_TRUE(stepped);
  EXPECT_NEAR(own_parameters(*stepped).front(), 1.0, 0.1);
  const double possible = recording.base.fitted.cost - recording.best_cost(*stepped);
  EXPECT_GT(recording.base.fitted.cost - stepped->fitted.cost, 0.9 * possible);
}

// A start a thousand times too large, and one that is too small.
TEST(FirstStep, HasTheSizeOfTheEffectFromAStartOfAnother) {
  const double force_n = 0.02;
  const Calibrated recording(shaken(force_n, 0.0));
  for (const double start_n : {1.0e3 * force_n, 0.05 * force_n}) {
    const auto stepped = recording.after("ambient_vibration", {{hum_hz, start_n, 0.0}});
    ASSERT_TRUE(stepped);
    EXPECT_NEAR(own_parameters(*stepped)[1], force_n, 0.1 * force_n) << "from " << start_n;
    const double possible = recording.base.fitted.cost - recording.best_cost(*stepped);
    EXPECT_GT(recording.base.fitted.cost - stepped->fitted.cost, 0.9 * possible);
  }
}

TEST(FirstStep, IsThatOfTheStartThatGainsMost) {
  const double phase_rad = 1.5;
  const Calibrated recording(shaken(0.02, phase_rad));
  std::vector<std::vector<double>> starts;
  for (const double each_hz : {2.4, hum_hz, 5.0}) {
    for (const double each_rad : {0.0, phase_rad, 3.0, 4.5})
      starts.push_back({each_hz, 0.1, each_rad});
  }
  const auto stepped = recording.after("ambient_vibration", starts);
  ASSERT_TRUE(stepped);
  EXPECT_DOUBLE_EQ(own_parameters(*stepped)[0], hum_hz);
  EXPECT_DOUBLE_EQ(own_parameters(*stepped)[2], phase_rad);
}

// A force in the opposite phase cannot become negative: the effect stays at its start.
TEST(FirstStep, DoesNotLeaveTheDomainOfTheStrength) {
  const Calibrated recording(shaken(0.02, 0.0));
  const auto stepped = recording.after("ambient_vibration", {{hum_hz, 0.1, 3.14159}});
  ASSERT_TRUE(stepped);
  EXPECT_DOUBLE_EQ(own_parameters(*stepped)[1], 0.1);
  EXPECT_GT(stepped->fitted.cost, recording.base.fitted.cost);
}

TEST(FirstStep, GainsNothingWhereNothingIsMissing) {
  const Calibrated recording(driven_mass());
  const auto stepped = recording.after("cubic_stiffness", {{0.0}});
  ASSERT_TRUE(stepped);
  EXPECT_LT(recording.base.fitted.cost - stepped->fitted.cost, 12.0);
}

TEST(FirstStep, IsNoneForAnEffectWithStatesOfItsOwn) {
  const Calibrated recording(driven_mass());
  EXPECT_FALSE(recording.after("hysteresis", {{100.0, 1.0, 0.0, 1.5}}));
}

}  // namespace
}  // namespace stickslip::diagnosis
