// SPDX-License-Identifier: Apache-2.0
// The real driver on emulated chips, for each generation of libgpiod.
#include "drivers/amplifier/amplifier.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "tests/emulated/gpio/emulated_gpio.h"
#include "tests/emulated/stepped_clock.h"

namespace stickslip::emulated {
namespace {

using drivers::Amplifier;
using drivers::Outcome;
using drivers::Result;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::int64_t ms = 1'000'000;
const std::string chip = "/dev/gpiochip3";
constexpr unsigned enable = 0;
constexpr unsigned fault = 1;
constexpr unsigned stop = 2;
constexpr unsigned heartbeat = 5;

class AmplifierBench : public testing::Test {
 protected:
  AmplifierBench() {
    gpio_.clear();
    gpio_.add_chip("/dev/gpiochip0", "pinctrl", {"a", "b"});
    gpio_.add_chip(chip, "cp2112_gpio", {"enable", "", "stop", "", "", "beat", "", ""});
    settings_.chip = "cp2112_gpio";
    settings_.enable = config::GpioLine{.line = "enable"};
    settings_.fault = config::GpioLine{.line = "1", .active_low = true};
    settings_.emergency_stop = config::GpioLine{.line = "stop",
                                                .active_low = true,
                                                .bias = config::GpioLine::Bias::pull_down,
                                                .debounce_s = 0.2};
    settings_.heartbeat = config::GpioLine{.line = "5"};
    settings_.heartbeat_period_s = 0.1;
    // Normally closed contacts to the supply: high in normal operation, low for a cut wire.
    gpio_.put(chip, fault, true);
    gpio_.put(chip, stop, true);
  }

  ~AmplifierBench() override {
    gpio_.hold_gets(false);
    gpio_.hold_sets(false);
  }

  Amplifier& make() {
    amplifier_ = std::make_unique<Amplifier>(settings_, clock_);
    return *amplifier_;
  }
  /// Opens it and waits until nothing is pressed.
  Amplifier& make_open() {
    Amplifier& amplifier = make();
    const Result result = amplifier.open();
    EXPECT_TRUE(result) << result.message;
    clock_.pass(300 * ms);
    EXPECT_TRUE(eventually([&] { return !amplifier.signals().emergency_stop; }));
    return amplifier;
  }
  static void let_pass(std::int64_t ns) {
    drivers::MonotonicHostClock real;
    real.sleep_until(real.now_ns() + ns);
  }
  /// Commands a state cycle by cycle until the line follows and no command is pending.
  bool becomes(bool on) {
    const bool did = eventually([&] {
      EXPECT_TRUE(amplifier_->write(on));
      return gpio_.level(chip, enable) == on;
    });
    for (int cycle = 0; cycle < 3; ++cycle) {
      let_pass(20 * ms);
      EXPECT_TRUE(amplifier_->write(on));
    }
    return did;
  }
  /// Expects only "off" commands from now on, whatever is written.
  void expect_never_on_again() {
    for (int cycle = 0; cycle < 5; ++cycle) {
      EXPECT_EQ(amplifier_->write(true).outcome, Outcome::lost);
      let_pass(20 * ms);
    }
    EXPECT_FALSE(gpio_.level(chip, enable)) << "not switched on after a loss";
  }
  /// Writes cycle by cycle until an outcome; counts the other outcomes.
  std::map<Outcome, int> until(bool on, Outcome awaited) {
    std::map<Outcome, int> before;
    EXPECT_TRUE(eventually([&] {
      const Outcome outcome = amplifier_->write(on).outcome;
      if (outcome == awaited) return true;
      ++before[outcome];
      return false;
    }));
    return before;
  }

  EmulatedGpio& gpio_ = emulated_gpio();
  SteppedClock clock_;
  config::Amplifier settings_;
  std::unique_ptr<Amplifier> amplifier_;
};

TEST_F(AmplifierBench, ChipIsFoundByPathNameAndLabel) {
  for (const char* name : {"/dev/gpiochip3", "gpiochip3", "cp2112_gpio"}) {
    settings_.chip = name;
    const Result result = make().open();
    EXPECT_TRUE(result) << result.message;
    EXPECT_EQ(gpio_.consumer(chip, enable), "stickslip");
    amplifier_.reset();
    EXPECT_EQ(gpio_.consumer(chip, enable), "");
  }
}

TEST_F(AmplifierBench, EnableIsActiveOnlyWhenCommanded) {
  for (const bool active_low : {false, true}) {
    settings_.enable->active_low = active_low;
    Amplifier& amplifier = make_open();
    EXPECT_TRUE(amplifier.write(false));
    amplifier.close();
    EXPECT_THAT(gpio_.history(chip, enable), Each(active_low));
    gpio_.clear();
    gpio_.add_chip(chip, "cp2112_gpio", {"enable", "", "stop", "", "", "beat", "", ""});
    gpio_.put(chip, stop, true);
  }
}

TEST_F(AmplifierBench, EnableFollowsASingleCall) {
  Amplifier& amplifier = make_open();
  for (const bool on : {true, false}) {
    EXPECT_TRUE(amplifier.write(on));
    EXPECT_TRUE(eventually([&] { return gpio_.level(chip, enable) == on; }));
    EXPECT_TRUE(amplifier.write(on));
  }
  EXPECT_TRUE(becomes(true));
  amplifier.close();
  EXPECT_FALSE(gpio_.level(chip, enable));
  EXPECT_THAT(gpio_.history(chip, enable), ElementsAre(false, true, false, true, false))
      << "set only on a change";
}

TEST_F(AmplifierBench, BeforeOpenOnlyOffSucceeds) {
  EXPECT_TRUE(make().write(false));
  EXPECT_EQ(amplifier_->write(true).outcome, Outcome::fatal);
}

TEST_F(AmplifierBench, HeartbeatTogglesWhileTheLoopRuns) {
  Amplifier& amplifier = make_open();
  const std::size_t before = gpio_.history(chip, heartbeat).size();
  drivers::MonotonicHostClock real;
  for (int cycle = 0; cycle < 1000; ++cycle) {
    clock_.pass(ms);
    ASSERT_TRUE(amplifier.write(false));
    real.sleep_until(real.now_ns() + ms);
  }
  real.sleep_until(real.now_ns() + 120 * ms);
  const std::vector<bool> beats = gpio_.history(chip, heartbeat);
  EXPECT_NEAR(static_cast<double>(beats.size() - before), 10.0, 1.0);
  for (std::size_t i = 1; i < beats.size(); ++i) EXPECT_NE(beats[i], beats[i - 1]);
  // The loop hangs: no heartbeat.
  clock_.pass(10000 * ms);
  real.sleep_until(real.now_ns() + 120 * ms);
  EXPECT_EQ(gpio_.history(chip, heartbeat).size(), beats.size());
  // The loop continues: one edge, not a hundred.
  for (int cycle = 0; cycle < 100; ++cycle) {
    ASSERT_TRUE(amplifier.write(false));
    real.sleep_until(real.now_ns() + ms);
  }
  EXPECT_EQ(gpio_.history(chip, heartbeat).size(), beats.size() + 1);
  amplifier.close();
  EXPECT_EQ(gpio_.history(chip, heartbeat).size(), beats.size() + 1);
}

TEST_F(AmplifierBench, UnknownLinesCountAsPressed) {
  Amplifier& amplifier = make();
  EXPECT_TRUE(amplifier.signals().emergency_stop);
  EXPECT_TRUE(amplifier.signals().amplifier_fault);
  ASSERT_TRUE(amplifier.open());
  clock_.pass(300 * ms);
  EXPECT_TRUE(eventually([&] { return !amplifier.signals().emergency_stop; }));
  EXPECT_FALSE(amplifier.signals().amplifier_fault);
  amplifier.close();
  EXPECT_TRUE(amplifier.signals().emergency_stop);
  settings_.emergency_stop.reset();
  settings_.fault.reset();
  EXPECT_FALSE(make().signals().emergency_stop) << "unconfigured";
  EXPECT_FALSE(amplifier_->signals().amplifier_fault);
}

TEST_F(AmplifierBench, PressingIsImmediateAndReleaseDebounced) {
  Amplifier& amplifier = make_open();
  EXPECT_EQ(gpio_.pull(chip, stop), Pull::down);
  gpio_.put(chip, stop, false);
  EXPECT_TRUE(eventually([&] { return amplifier.signals().emergency_stop; }));
  gpio_.put(chip, stop, true);
  drivers::MonotonicHostClock real;
  real.sleep_until(real.now_ns() + 120 * ms);
  EXPECT_TRUE(amplifier.signals().emergency_stop) << "within the 200 ms";
  clock_.pass(150 * ms);
  // Bouncing restarts the hold time.
  gpio_.put(chip, stop, false);
  gpio_.put(chip, stop, true);
  real.sleep_until(real.now_ns() + 120 * ms);
  clock_.pass(150 * ms);
  real.sleep_until(real.now_ns() + 120 * ms);
  EXPECT_TRUE(amplifier.signals().emergency_stop);
  clock_.pass(60 * ms);
  EXPECT_TRUE(eventually([&] { return !amplifier.signals().emergency_stop; }));
}

TEST_F(AmplifierBench, PulseBetweenSamplesIsDetected) {
  Amplifier& amplifier = make_open();
  gpio_.put(chip, stop, false);
  gpio_.put(chip, stop, true);
  EXPECT_TRUE(eventually([&] { return amplifier.signals().emergency_stop; }));
}

TEST_F(AmplifierBench, PulseLastsATenthOfASecondWithoutDebouncing) {
  Amplifier& amplifier = make_open();
  ASSERT_FALSE(amplifier.signals().amplifier_fault);
  gpio_.put(chip, fault, false);
  gpio_.put(chip, fault, true);
  EXPECT_TRUE(eventually([&] { return amplifier.signals().amplifier_fault; }));
  clock_.pass(99 * ms);
  drivers::MonotonicHostClock real;
  real.sleep_until(real.now_ns() + 120 * ms);  // sampled twice
  EXPECT_TRUE(amplifier.signals().amplifier_fault);
  clock_.pass(ms);
  EXPECT_TRUE(eventually([&] { return !amplifier.signals().amplifier_fault; }));
}

TEST_F(AmplifierBench, StaleLinesCountAsPressed) {
  Amplifier& amplifier = make_open();
  ASSERT_TRUE(becomes(true));
  drivers::MonotonicHostClock real;
  real.sleep_until(real.now_ns() + 120 * ms);  // sampled at this time
  gpio_.hold_gets(true);                       // sampling hangs in the chip's driver
  clock_.pass(300 * ms);
  const drivers::Signals before = amplifier.signals();
  EXPECT_FALSE(before.emergency_stop || before.amplifier_fault);
  clock_.pass(1);
  const drivers::Signals after = amplifier.signals();
  EXPECT_TRUE(after.emergency_stop);
  EXPECT_TRUE(after.amplifier_fault);
  EXPECT_TRUE(becomes(false)) << "off does not depend on sampling";
  gpio_.hold_gets(false);
  EXPECT_TRUE(eventually([&] {
    const drivers::Signals now = amplifier.signals();
    return !now.emergency_stop && !now.amplifier_fault;
  }));
}

TEST_F(AmplifierBench, HungChipIsLostWithoutBlocking) {
  Amplifier& amplifier = make_open();
  ASSERT_TRUE(becomes(true));
  drivers::MonotonicHostClock real;
  // The due heartbeat hangs in the chip's driver, and the loop continues.
  gpio_.hold_sets(true);
  clock_.pass(100 * ms);
  ASSERT_TRUE(amplifier.write(true));
  // "Off" is commanded meanwhile, and queued.
  clock_.pass(100 * ms);
  ASSERT_TRUE(amplifier.write(false));
  clock_.pass(200 * ms);
  EXPECT_TRUE(amplifier.write(false)) << "within 0.3 s of the first";
  clock_.pass(1);
  const Result result = amplifier.write(false);
  EXPECT_EQ(result.outcome, Outcome::lost);
  EXPECT_THAT(result.message, HasSubstr("cp2112_gpio of the amplifier does not respond"));
  EXPECT_TRUE(amplifier.signals().emergency_stop);
  EXPECT_TRUE(amplifier.signals().amplifier_fault);
  EXPECT_EQ(amplifier.switch_off().outcome, Outcome::lost);
  EXPECT_TRUE(gpio_.level(chip, enable));
  gpio_.hold_sets(false);
  EXPECT_TRUE(eventually([&] { return !gpio_.level(chip, enable); }))
      << "off is carried out eventually";
  expect_never_on_again();
  EXPECT_TRUE(amplifier.open());
  EXPECT_TRUE(becomes(true));
}

TEST_F(AmplifierBench, HeartbeatsDoNotAccumulateOnASlowChip) {
  Amplifier& amplifier = make_open();
  ASSERT_TRUE(becomes(true));
  gpio_.hold_sets(true);
  clock_.pass(100 * ms);
  for (int cycle = 0; cycle < 20; ++cycle) {
    ASSERT_TRUE(amplifier.write(cycle < 10));
    clock_.pass(10 * ms);
  }
  const std::size_t beats = gpio_.history(chip, heartbeat).size();
  gpio_.hold_sets(false);
  EXPECT_TRUE(eventually([&] { return !gpio_.level(chip, enable); }));
  let_pass(60 * ms);
  EXPECT_LE(gpio_.history(chip, heartbeat).size(), beats + 1) << "heartbeats do not accumulate";
}

TEST_F(AmplifierBench, SwitchOffConfirmsTheLevel) {
  EXPECT_TRUE(make().switch_off()) << "not open: it is off";
  Amplifier& amplifier = make_open();
  ASSERT_TRUE(becomes(true));
  gpio_.fail_next_sets(chip, 2);
  EXPECT_TRUE(amplifier.switch_off());
  EXPECT_FALSE(gpio_.level(chip, enable));
  ASSERT_TRUE(becomes(true));
  gpio_.fail_next_sets(chip, 1000);
  const Result result = amplifier.switch_off();
  EXPECT_EQ(result.outcome, Outcome::lost);
  EXPECT_THAT(result.message, HasSubstr("cp2112_gpio"));
}

TEST_F(AmplifierBench, SwitchOffDoesNotWaitForAHungChip) {
  Amplifier& amplifier = make_open();
  ASSERT_TRUE(becomes(true));
  gpio_.hold_sets(true);
  const Result result = amplifier.switch_off();
  EXPECT_EQ(result.outcome, Outcome::lost);
  EXPECT_THAT(result.message, HasSubstr("does not respond"));
}

TEST_F(AmplifierBench, IneffectiveSetIsDetected) {
  Amplifier& amplifier = make_open();
  ASSERT_TRUE(becomes(true));
  gpio_.swallow_next_sets(chip, 2);
  EXPECT_TRUE(amplifier.switch_off());
  EXPECT_FALSE(gpio_.level(chip, enable));
  ASSERT_TRUE(becomes(true));
  gpio_.swallow_next_sets(chip, 1000);
  EXPECT_EQ(amplifier.switch_off().outcome, Outcome::lost);
  EXPECT_TRUE(gpio_.level(chip, enable));
}

TEST_F(AmplifierBench, ChipWithoutReadBackIsTrusted) {
  gpio_.set_read_back(chip, false);
  Amplifier& amplifier = make_open();
  EXPECT_TRUE(becomes(true));
  EXPECT_TRUE(amplifier.switch_off());
  EXPECT_FALSE(gpio_.level(chip, enable));
}

TEST_F(AmplifierBench, HeartbeatAloneLeavesNoContactClosed) {
  settings_.enable.reset();
  Amplifier& amplifier = make_open();
  gpio_.hold_sets(true);
  clock_.pass(100 * ms);
  EXPECT_TRUE(amplifier.switch_off());
}

TEST_F(AmplifierBench, UnconfiguredInputIsInactive) {
  settings_.emergency_stop.reset();
  Amplifier& amplifier = make();
  ASSERT_TRUE(amplifier.open());
  EXPECT_TRUE(eventually([&] { return !amplifier.signals().amplifier_fault; }));
  gpio_.unplug(chip);
  EXPECT_TRUE(eventually([&] { return amplifier.signals().amplifier_fault; }));
  EXPECT_EQ(amplifier.write(true).outcome, Outcome::lost);
  EXPECT_FALSE(amplifier.signals().emergency_stop) << "write reports the loss";
  settings_.fault.reset();
  EXPECT_EQ(make().open().outcome, Outcome::lost);
  EXPECT_FALSE(amplifier_->signals().amplifier_fault);
}

TEST_F(AmplifierBench, FloatingWireNeitherHidesOthersNorBlocksClose) {
  Amplifier& amplifier = make_open();
  gpio_.let_float(chip, fault, true);
  gpio_.put(chip, fault, false);
  EXPECT_TRUE(eventually([&] { return amplifier.signals().amplifier_fault; }));
  gpio_.put(chip, stop, false);
  const bool seen = eventually([&] { return amplifier.signals().emergency_stop; });
  EXPECT_TRUE(seen);
  if (!seen) gpio_.let_float(chip, fault, false);  // otherwise the test would not end
  amplifier.close();
  EXPECT_EQ(gpio_.consumer(chip, fault), "");
}

TEST_F(AmplifierBench, LostEdgeIsHarmless) {
  Amplifier& amplifier = make_open();
  gpio_.put(chip, fault, false, false);
  EXPECT_TRUE(eventually([&] { return amplifier.signals().amplifier_fault; }));
  gpio_.put(chip, fault, true, false);
  drivers::MonotonicHostClock real;
  real.sleep_until(real.now_ns() + 120 * ms);
  clock_.pass(100 * ms);
  EXPECT_TRUE(eventually([&] { return !amplifier.signals().amplifier_fault; }));
}

TEST_F(AmplifierBench, ChipWithoutEdgesIsSampled) {
  gpio_.set_edge_support(chip, false);
  Amplifier& amplifier = make_open();
  gpio_.put(chip, stop, false);
  EXPECT_TRUE(eventually([&] { return amplifier.signals().emergency_stop; }));
}

TEST_F(AmplifierBench, BusyLineNamesItsUser) {
  gpio_.occupy(chip, heartbeat, "sysfs");
  const Result result = make().open();
  EXPECT_EQ(result.outcome, Outcome::needs_attention);
  EXPECT_THAT(result.message, HasSubstr("line 5"));
  EXPECT_THAT(result.message, HasSubstr("\"sysfs\""));
  EXPECT_EQ(gpio_.consumer(chip, enable), "") << "all lines are released";
  gpio_.occupy(chip, heartbeat, "");
  gpio_.occupy(chip, stop, "gpio-keys");
  const Result again = amplifier_->open();
  EXPECT_THAT(again.message, HasSubstr("\"gpio-keys\""));
  EXPECT_EQ(gpio_.consumer(chip, enable), "");
  gpio_.occupy(chip, stop, "");
  EXPECT_TRUE(amplifier_->open());
}

TEST_F(AmplifierBench, DeniedPermissionNamesTheGroup) {
  gpio_.forbid(chip, true);
  for (const char* name : {"/dev/gpiochip3", "cp2112_gpio"}) {
    settings_.chip = name;
    const Result result = make().open();
    EXPECT_EQ(result.outcome, Outcome::needs_attention);
    EXPECT_THAT(result.message, HasSubstr("sudo usermod -aG stickslip $USER"));
    EXPECT_THAT(result.message, HasSubstr("log in again"));
  }
}

TEST_F(AmplifierBench, MissingChipIsLostAndMissingLineNeedsAttention) {
  settings_.chip = "gpiochip9";
  Result result = make().open();
  EXPECT_EQ(result.outcome, Outcome::lost);
  EXPECT_THAT(result.message, HasSubstr("gpiochip0 [pinctrl], gpiochip3 [cp2112_gpio]"));
  settings_.chip = "gpiochip3";
  for (const char* line : {"8", "nonesuch"}) {
    settings_.fault->line = line;
    result = make().open();
    EXPECT_EQ(result.outcome, Outcome::needs_attention);
    EXPECT_THAT(result.message, HasSubstr("gpioinfo"));
  }
}

TEST_F(AmplifierBench, AmbiguousLabelNeedsAttention) {
  gpio_.add_chip("/dev/gpiochip7", "cp2112_gpio", {"x"});
  const Result result = make().open();
  EXPECT_EQ(result.outcome, Outcome::needs_attention);
  EXPECT_THAT(result.message, HasSubstr("gpiochip3 [cp2112_gpio], gpiochip7 [cp2112_gpio]"));
}

TEST_F(AmplifierBench, UnpluggedChipIsLostAndActivatesAllStops) {
  Amplifier& amplifier = make_open();
  ASSERT_TRUE(becomes(true));
  gpio_.unplug(chip);
  EXPECT_TRUE(eventually([&] { return amplifier.signals().emergency_stop; }))
      << "without any write";
  EXPECT_EQ(amplifier.write(true).outcome, Outcome::lost);
  const Result result = amplifier.write(false);
  EXPECT_EQ(result.outcome, Outcome::lost);
  EXPECT_THAT(result.message, HasSubstr("is disconnected"));
  amplifier.close();
  EXPECT_EQ(amplifier.open().outcome, Outcome::lost);
  gpio_.add_chip(chip, "cp2112_gpio", {"enable", "", "stop", "", "", "beat", "", ""});
  gpio_.put(chip, stop, true);
  EXPECT_TRUE(amplifier.open());
  EXPECT_TRUE(becomes(true));
}

TEST_F(AmplifierBench, OffIsRepeatedAfterAnError) {
  Amplifier& amplifier = make_open();
  ASSERT_TRUE(becomes(true));
  gpio_.fail_next_sets(chip, 2);
  int failures = 0;
  EXPECT_TRUE(eventually([&] {
    const Outcome outcome = amplifier.write(false).outcome;
    EXPECT_TRUE(outcome == Outcome::ok || outcome == Outcome::temporary);
    failures += outcome == Outcome::temporary ? 1 : 0;
    return !gpio_.level(chip, enable);
  }));
  EXPECT_EQ(failures, 2) << "each is reported once";
  gpio_.fail_next_sets(chip, 3);
  EXPECT_EQ(until(true, Outcome::lost)[Outcome::temporary], 2);
  EXPECT_TRUE(amplifier.signals().emergency_stop);
  expect_never_on_again();
}

TEST_F(AmplifierBench, ChipsAreListedWithTheirProblems) {
  gpio_.forbid("/dev/gpiochip0", true);
  const auto found = drivers::find_gpio_chips();
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].location, "/dev/gpiochip0");
  EXPECT_THAT(found[0].problem, HasSubstr("udev"));
  EXPECT_EQ(found[1].serial, "gpiochip3");
  EXPECT_EQ(found[1].name, "cp2112_gpio, 8 lines");
  EXPECT_EQ(found[1].problem, "");
}

}  // namespace
}  // namespace stickslip::emulated
