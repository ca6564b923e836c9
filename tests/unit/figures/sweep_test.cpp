// SPDX-License-Identifier: Apache-2.0
#include "tools/figures/sweep.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace stickslip::figures {
namespace {

physics::Model bare_mass() {
  physics::Model model;
  model.oscillator.mass_kg = {0.06};
  model.oscillator.natural_frequency_hz = physics::Parameter{2.4};
  model.oscillator.damping_ratio = physics::Parameter{0.2};
  return model;
}

TEST(Sweep, GivesTheSteadyStateOfALinearOscillator) {
  Sweep sweep;
  sweep.frequency_hz = 4.0;
  sweep.amplitude_m = 2.0e-3;
  sweep.transient_s = 10.0;
  sweep.duration_s = 1.0;
  const auto got = record(bare_mass(), sweep);
  ASSERT_EQ(got.frames.size(), 1001U);
  EXPECT_EQ(got.frames[1].time_ns, 1000000);
  const double r = 4.0 / 2.4;
  const double expected =
      2.0e-3 * r * r / std::sqrt(std::pow(1.0 - r * r, 2) + std::pow(2.0 * 0.2 * r, 2));
  double largest = 0.0;
  for (const Frame& frame : got.frames) {
    largest = std::max(largest, frame[Channel::displacement]);
  }
  EXPECT_NEAR(largest, expected, 2.0e-4 * expected);
}

TEST(Sweep, IsModulatedBetweenItsLargestAndSmallestAmplitude) {
  Sweep sweep;
  sweep.frequency_hz = 10.0;
  sweep.amplitude_m = 3.0e-3;
  sweep.modulation_hz = 0.5;
  sweep.modulation_depth = 0.8;
  sweep.transient_s = 2.0;
  sweep.duration_s = 2.0;
  const auto got = record(bare_mass(), sweep);
  const auto largest = [&](std::size_t from, std::size_t to) {
    double out = 0.0;
    for (std::size_t i = from; i < to; ++i) {
      out = std::max(out, std::abs(got.frames[i][Channel::base_displacement]));
    }
    return out;
  };
  EXPECT_NEAR(largest(0, 100), 3.0e-3, 0.05e-3);
  EXPECT_NEAR(largest(950, 1050), 0.6e-3, 0.05e-3);
}

TEST(Sweep, RefusesAModelThatIsNotDrivenByItsBase) {
  physics::Model model = bare_mass();
  model.oscillator.excitation = physics::Excitation::force;
  EXPECT_THROW(record(model, {}), std::invalid_argument);
}

}  // namespace
}  // namespace stickslip::figures
