// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/separation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "physics/catalogue.h"
#include "tests/unit/diagnosis/bench.h"

namespace stickslip::diagnosis {
namespace {

using test::driven_mass;
using test::experiment_of;
using test::record;

// One amplitude at one frequency.
double steady_force_n(double time_s) {
  return 1.2 * std::sin(2.0 * std::numbers::pi * 1.6 * time_s);
}

Experiment steady_run() {
  return experiment_of(record(driven_mass(), 16.0, 1, true, steady_force_n), driven_mass());
}

Hypothesis with(const char* id, double size) {
  const Hypothesis declared(driven_mass());
  return declared.with(*physics::find_effect(id), {}, std::vector<double>{size}, {});
}

// Springs that harden with the third and the fifth power are equivalent at one amplitude.
TEST(Separation, SuggestsAnotherAmplitudeForPowersOfDeflection) {
  const Experiment run = steady_run();
  const double x = run.largest.displacement_m;
  const double k3 = 1.0e-4 / (x * x * x);
  const Hypothesis cubic = with("cubic_stiffness", 300.0 * k3);
  const Hypothesis quintic = with("quintic_stiffness", 300.0 * 1.14 * k3 / (x * x));
  const std::vector<double> z(3, 0.0);
  const auto separation = separation_of(run, {&cubic, z}, {&quintic, z}, 0.4, 1, 2);
  ASSERT_TRUE(separation.has_value());
  EXPECT_NE(separation->run.find("as large"), std::string::npos) << separation->run;
  EXPECT_GT(separation->chi2_excess, 3.0 * separation->chi2_repeated);
  const std::string sentence = sentence_of(*separation);
  EXPECT_TRUE(sentence.starts_with(separation->run)) << sentence;
}

TEST(Separation, IsAbsentForIdenticalHypotheses) {
  const Experiment run = steady_run();
  const Hypothesis cubic = with("cubic_stiffness", 500.0);
  const std::vector<double> z(3, 0.0);
  EXPECT_FALSE(separation_of(run, {&cubic, z}, {&cubic, z}, 0.4, 1, 2).has_value());
}

TEST(Separation, DoesNotDependOnTheNumberOfThreads) {
  const Experiment run = steady_run();
  const Hypothesis cubic = with("cubic_stiffness", 3000.0);
  const Hypothesis drag = with("quadratic_drag", 1.0);
  const std::vector<double> z(3, 0.0);
  const auto one = separation_of(run, {&cubic, z}, {&drag, z}, 0.4, 1, 1);
  const auto two = separation_of(run, {&cubic, z}, {&drag, z}, 0.4, 1, 2);
  ASSERT_EQ(one.has_value(), two.has_value());
  if (one) {
    EXPECT_EQ(one->run, two->run);
    EXPECT_EQ(one->chi2_excess, two->chi2_excess);
  }
}

}  // namespace
}  // namespace stickslip::diagnosis
