// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/noise_check.h"

#include <gtest/gtest.h>

#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using test::all_windows;
using test::driven_mass;
using test::experiment_of;
using test::record;
using test::with_term;

NoiseCheck checked(const physics::Model& truth, bool estimated = false) {
  const std::vector<Experiment> experiments{experiment_of(record(truth, 24.0), driven_mass())};
  const Hypothesis hypothesis(driven_mass());
  const std::vector<double> z(hypothesis.unknowns().size(), 0.0);
  return noise_check(all_windows(experiments), hypothesis, z, estimated, {});
}

physics::Model with_noise(double factor) {
  auto truth = driven_mass();
  truth.sensors[index_of(Channel::displacement)].noise_std = factor * 2.0e-5;
  return truth;
}

TEST(NoiseCheck, FindsNoiseAsExpected) {
  const NoiseCheck got = checked(driven_mass());
  EXPECT_TRUE(got.is_noise);
  ASSERT_EQ(got.level.size(), 1U);
  EXPECT_NEAR(got.level[0].level, 1.0, 0.05);
  EXPECT_FALSE(got.level[0].differs);
}

TEST(NoiseCheck, MeasuresNoiseOfAnotherLevel) {
  EXPECT_TRUE(checked(with_noise(0.5)).is_noise);
  for (const double factor : {1.5, 4.0}) {
    const NoiseCheck got = checked(with_noise(factor));
    EXPECT_TRUE(got.is_noise) << factor;
    ASSERT_EQ(got.level.size(), 1U) << factor;
    EXPECT_TRUE(got.level[0].differs);
    EXPECT_NEAR(got.level[0].level, factor, 0.05 * factor);
  }
}

// An estimate may be wrong by a fifth of the power.
TEST(NoiseCheck, AllowsForTheErrorOfAnEstimate) {
  EXPECT_TRUE(checked(with_noise(1.08)).level.at(0).differs);
  EXPECT_FALSE(checked(with_noise(1.08), true).level.at(0).differs);
}

// Neither a small misfit everywhere nor one in a few windows is noise.
TEST(NoiseCheck, TakesNoMisfitForNoise) {
  EXPECT_FALSE(checked(with_term(driven_mass(), "bias_force", {{"force_n", {0.02}}})).is_noise);
  EXPECT_FALSE(checked(with_term(driven_mass(), "force_episode",
                                 {{"force_n", {0.1}}, {"begin_s", {11.0}}, {"end_s", {12.0}}}))
                   .is_noise);
}

}  // namespace
}  // namespace stickslip::diagnosis
