#include "daemon/excitation.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace stickslip::daemon {
namespace {

constexpr double two_pi = 2.0 * std::numbers::pi;
constexpr double dt = 1e-3;

config::Excitation sine(double amplitude, double carrier_hz) {
  config::Excitation out;
  out.enabled = true;
  out.amplitude = amplitude;
  out.carrier_hz = carrier_hz;
  out.ramp_s = 0.5;
  return out;
}

void run(Excitation& excitation, double seconds) {
  for (int i = 0; i < static_cast<int>(std::lround(seconds / dt)); ++i) excitation.advance(dt);
}

TEST(Excitation, IsZeroUntilStartedAndWhereDisabled) {
  Excitation off(sine(0.008, 2.5));
  EXPECT_EQ(off.advance(1.0).value, 0.0);
  config::Excitation disabled = sine(0.008, 2.5);
  disabled.enabled = false;
  Excitation excitation(disabled);
  excitation.start();
  EXPECT_EQ(excitation.advance(1.0).value, 0.0);
  EXPECT_TRUE(excitation.is_off());
}

TEST(Excitation, IsTheSineThatWasAskedForAfterTheRamp) {
  Excitation excitation(sine(0.008, 2.5));
  excitation.start();
  double t = 0.0;
  for (int i = 0; i < 20000; ++i) {
    const Drive drive = excitation.advance(dt);
    t += dt;
    if (i >= 500) {
      ASSERT_NEAR(drive.value, 0.008 * std::sin(two_pi * 2.5 * t), 1e-12) << "at " << t << " s";
      ASSERT_DOUBLE_EQ(drive.amplitude, 0.008);
    }
  }
  EXPECT_EQ(excitation.state(), Excitation::State::steady);
}

TEST(Excitation, ModulationFollowsTheConfigurationsFormula) {
  config::Excitation settings = sine(0.01, 3.0);
  settings.modulation_hz = 0.1;
  settings.modulation_depth = 1.0;
  settings.ramp_s = 0.0;
  Excitation excitation(settings);
  excitation.start();
  for (int i = 1; i <= 20000; ++i) {
    const double t = i * dt;
    const double amplitude = 0.01 * (0.5 + 0.5 * std::cos(two_pi * 0.1 * t));
    ASSERT_NEAR(excitation.advance(dt).value, amplitude * std::sin(two_pi * 3.0 * t), 1e-12);
  }
}

TEST(Excitation, EnvelopeIsInterpolatedAndRepeated) {
  config::Excitation settings = sine(0.0, 3.0);
  settings.ramp_s = 0.0;
  settings.envelope = {{0.0, 0.0}, {1.0, 0.01}, {2.0, 0.0}};
  Excitation repeated(settings);
  repeated.start();
  run(repeated, 2.5);
  EXPECT_NEAR(repeated.now().amplitude, 0.005, 1e-9);
  settings.repeat = false;
  settings.envelope.back().amplitude = 0.002;
  Excitation once(settings);
  once.start();
  run(once, 5.0);
  EXPECT_NEAR(once.now().amplitude, 0.002, 1e-12);
}

TEST(Excitation, RampsToExactlyZeroWithinRampTimeFromAnyMoment) {
  for (const double before : {0.0, 0.1, 0.25, 0.5, 3.7}) {
    Excitation excitation(sine(0.008, 2.5));
    excitation.start();
    run(excitation, before);
    excitation.stop();
    int cycles = 0;
    while (!excitation.is_off()) {
      excitation.advance(dt);
      ASSERT_LE(++cycles, 501) << "stopped at " << before << " s";
    }
    EXPECT_EQ(excitation.now().value, 0.0);
    EXPECT_EQ(excitation.now().amplitude, 0.0);
  }
}

TEST(Excitation, CutIsZeroAtOnce) {
  Excitation excitation(sine(0.008, 2.5));
  excitation.start();
  run(excitation, 1.03);
  ASSERT_NE(excitation.now().value, 0.0);
  excitation.cut();
  EXPECT_EQ(excitation.now().value, 0.0);
  EXPECT_EQ(excitation.advance(dt).value, 0.0);
}

// Between two steps the drive may not move faster than carrier, modulation and ramp together
// explain, whatever happens to the excitation in between.
RC_GTEST_PROP(Excitation, NeverJumps, ()) {
  config::Excitation settings = sine(0.01, *rc::gen::inRange(1, 20) * 0.5);
  settings.modulation_hz = *rc::gen::inRange(0, 10) * 0.1;
  settings.modulation_depth = *rc::gen::inRange(0, 11) * 0.1;
  settings.ramp_s = *rc::gen::inRange(1, 10) * 0.1;
  const double rate = two_pi * 10.0 + 0.5 * two_pi * settings.modulation_hz + 1.5 / settings.ramp_s;
  const double largest_step = 0.01 * rate * dt * 1.01;

  Excitation excitation(settings);
  double previous = 0.0;
  for (const int action : *rc::gen::container<std::vector<int>>(
           2000, rc::gen::weightedElement<int>({{500, 0}, {1, 1}, {1, 2}, {1, 3}}))) {
    if (action == 1) excitation.start();
    if (action == 2) excitation.stop();
    if (action == 3) excitation.set_carrier_hz(*rc::gen::inRange(1, 20) * 0.5);
    const double value = excitation.advance(dt).value;
    RC_ASSERT(std::abs(value - previous) <= largest_step);
    previous = value;
  }
}

}  // namespace
}  // namespace stickslip::daemon
