// SPDX-License-Identifier: Apache-2.0
// Checks of the settings, before access to the bus. The rest is tested with the emulated board.
#include "drivers/labjack_u6/labjack_u6_driver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>

namespace stickslip::drivers {
namespace {

using testing::HasSubstr;

struct Bench {
  config::LabjackU6 settings;
  config::BenchInputs inputs{};
  double rate_hz = 1000.0;
  MonotonicHostClock clock;

  Bench() {
    input(Channel::displacement) = {"labjack_u6", "AIN0"};
    input(Channel::velocity) = {"labjack_u6", "AIN2", 1.0, true};
  }
  config::BenchInput& input(Channel channel) {
    auto& place = inputs[index_of(channel)];
    if (!place) place.emplace();
    return *place;
  }
  void renew() {
    const Bench fresh;
    settings = fresh.settings;
    inputs = fresh.inputs;
    rate_hz = fresh.rate_hz;
  }
  void expect_refusal(const std::string& words) {
    LabjackU6Driver driver(settings, inputs, rate_hz, clock);
    const Result result = driver.open();
    EXPECT_EQ(result.outcome, Outcome::needs_attention);
    EXPECT_THAT(result.message, HasSubstr(words));
  }
};

TEST(LabjackU6Driver, DescribesItselfBeforeItIsOpen) {
  Bench bench;
  const LabjackU6Driver driver(bench.settings, bench.inputs, bench.rate_hz, bench.clock);
  const Description& description = driver.description();
  EXPECT_EQ(description.channels, 0b11);
  EXPECT_STREQ(description.unit[0], "V");
  EXPECT_TRUE(description.paced);
  EXPECT_TRUE(description.own_clock);
  EXPECT_TRUE(description.can_drive);
  EXPECT_FALSE(description.stepped_time);
}

TEST(LabjackU6Driver, RejectsUnsupportedSettings) {
  Bench bench;
  bench.input(Channel::displacement).input = "AIN14";
  bench.expect_refusal("inputs.displacement = labjack_u6/AIN14: the board's inputs are");
  bench.renew();
  bench.input(Channel::velocity).input = "AIN3";
  bench.expect_refusal("begins with an even input");
  bench.renew();
  bench.input(Channel::velocity).range_v = 5.0;
  bench.expect_refusal("range_v = 5: must be 10, 1, 0.1 or 0.01");
  bench.renew();
  bench.inputs = {};
  bench.expect_refusal("no channel is assigned to labjack_u6");
  bench.renew();
  bench.rate_hz = 30000.0;
  bench.expect_refusal("at most 25000 Hz");
  bench.rate_hz = 17123.45;
  bench.expect_refusal("The nearest is 17124.5095");
  bench.rate_hz = std::numeric_limits<double>::quiet_NaN();
  bench.expect_refusal("must be positive");
}

TEST(LabjackU6Driver, RejectsContradictorySettings) {
  Bench bench;
  bench.settings.enable_line = 20;
  bench.expect_refusal("enable_line = 20: the board has lines 0 to 19");
  bench.settings.enable_line = 17;
  bench.expect_refusal("watchdog reaches lines 0 to 15 only");
  bench.settings.enable_line = 3;
  bench.settings.emergency_stop_line = 3;
  bench.expect_refusal("needs a separate line");
  bench.renew();
  bench.settings.samples_per_packet = 26;
  bench.expect_refusal("samples_per_packet = 26: must be 1 to 25");
  bench.renew();
  bench.settings.resolution_index = 9;
  bench.expect_refusal("resolution_index = 9: must be 0 to 8");
}

TEST(LabjackU6Driver, IsOffWhileNotStarted) {
  Bench bench;
  LabjackU6Driver driver(bench.settings, bench.inputs, bench.rate_hz, bench.clock);
  Frame frame;
  frame.sequence = 77;
  EXPECT_EQ(driver.start().outcome, Outcome::fatal);
  EXPECT_EQ(driver.read(frame).outcome, Outcome::fatal);
  EXPECT_EQ(frame.sequence, 77U);
  EXPECT_EQ(driver.write({0.0, true}).outcome, Outcome::fatal);
  EXPECT_TRUE(driver.write({0.0, false}));
  EXPECT_FALSE(driver.signals().emergency_stop);
  driver.stop();
  driver.close();
  driver.close();
}

}  // namespace
}  // namespace stickslip::drivers
