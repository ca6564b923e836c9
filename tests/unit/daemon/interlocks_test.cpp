// SPDX-License-Identifier: Apache-2.0
#include "daemon/interlocks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <span>
#include <string>

namespace stickslip::daemon {
namespace {

using drivers::Outcome;
using testing::HasSubstr;

constexpr std::int64_t ms = 1'000'000;
constexpr std::uint8_t two_channels = 0b11;

InterlockSettings strict() {
  InterlockSettings out;
  out.longest_silence_ns = 100 * ms;
  out.stale_after_ns = 50 * ms;
  out.longest_overrun_ns = 5 * ms;
  out.dead_man_ns = 500 * ms;
  out.not_finite = true;
  out.observer_diverged = true;
  out.recorder_failing = true;
  out.range[index_of(Channel::velocity)] = {-0.5, 0.5};
  return out;
}

Frame good() {
  Frame frame;
  frame.set(Channel::displacement, 0.001);
  frame.set(Channel::velocity, 0.1);
  return frame;
}

struct Watched {
  explicit Watched(const InterlockSettings& settings = strict())
      : interlocks(settings, two_channels) {
    interlocks.read_result({}, 0);
    interlocks.frame(good(), 0, 0);
  }
  Interlock now(std::int64_t at) const { return interlocks.broken(at).interlock; }
  std::string cause(std::int64_t at) const { return interlocks.broken(at).cause.c_str(); }
  Interlocks interlocks;
};

TEST(Interlocks, AllHoldOnAGoodRig) { EXPECT_EQ(Watched().now(ms), Interlock::none); }

struct Case {
  Interlock interlock;
  void (*break_it)(Interlocks&);
  void (*restore_it)(Interlocks&);
  const char* cause;  // contained in it
};

void good_frame(Interlocks& i) { i.frame(good(), 0, 10 * ms); }

constexpr Case device_cases[] = {
    {Interlock::emergency_stop, [](Interlocks& i) { i.signals({.emergency_stop = true}); },
     [](Interlocks& i) { i.signals({}); }, "emergency stop"},
    {Interlock::amplifier_fault, [](Interlocks& i) { i.signals({.amplifier_fault = true}); },
     [](Interlocks& i) { i.signals({}); }, "amplifier"},
    {Interlock::device_lost,
     [](Interlocks& i) {
       i.read_result({Outcome::lost, "cable pulled"}, ms);
     },
     [](Interlocks& i) { i.read_result({}, ms); }, "cable pulled"},
    {Interlock::device_lost,
     [](Interlocks& i) {
       i.write_result({Outcome::fatal, "DAC gone"}, ms);
     },
     [](Interlocks& i) {
       i.device_restored();
       good_frame(i);
     },
     "DAC gone"},
    {Interlock::device_silent,
     [](Interlocks& i) {
       i.read_result({Outcome::temporary, "checksum"}, -90 * ms);
     },
     [](Interlocks& i) { i.read_result({}, ms); }, "checksum"},
    {Interlock::device_silent,
     [](Interlocks& i) {
       i.read_result({Outcome::no_data, ""}, -90 * ms);
     },
     [](Interlocks& i) { i.read_result({}, ms); }, "yields no data"},
    {Interlock::output_differs,
     [](Interlocks& i) {
       i.signals({.differing_output = {"the drive", 2.5, 3.1, 3.25, " V"}});
     },
     [](Interlocks& i) { i.signals({}); }, "the drive reads back as 2.5 V where 3.1 to 3.25 V"},
    {Interlock::part_lost,
     [](Interlocks& i) { i.signals({.lost_device = "the bridge is disconnected"}); },
     [](Interlocks& i) { i.signals({}); }, "the bridge is disconnected"},
};

constexpr Case channel_cases[] = {
    {Interlock::stale_channel,
     [](Interlocks& i) {
       Frame frame = good();
       frame.age_us[1] = 60'000;
       i.frame(frame, 0, 10 * ms);
     },
     good_frame, "velocity was last measured 60 ms ago"},
    {Interlock::not_finite, [](Interlocks& i) { i.frame(good(), 0b10, 10 * ms); }, good_frame,
     "velocity is not a finite number"},
    {Interlock::out_of_range,
     [](Interlocks& i) {
       Frame frame = good();
       frame.set(Channel::velocity, 0.75);
       i.frame(frame, 0, 10 * ms);
     },
     good_frame, "velocity was 0.75 m/s, beyond its limits of -0.5 and 0.5"},
};

constexpr Case daemon_cases[] = {
    {Interlock::overrun, [](Interlocks& i) { i.cycle_late(7 * ms); },
     [](Interlocks& i) { i.cycle_late(0); }, "7 ms late"},
    {Interlock::drive_not_finite, [](Interlocks& i) { i.drive(false); },
     [](Interlocks& i) { i.drive(true); }, "not a finite number"},
    {Interlock::recorder_failing, [](Interlocks& i) { i.recorder(true); },
     [](Interlocks& i) { i.recorder(false); }, "losing frames"},
    {Interlock::observer_diverged, [](Interlocks& i) { i.observer_restarted(true); },
     [](Interlocks& i) { i.observer_restarted(false); }, "diverged"},
    {Interlock::client_gone, [](Interlocks& i) { i.dead_man(-500 * ms); },
     [](Interlocks& i) { i.dead_man({}); }, "does not respond"},
};

void expect_broken_and_restored(std::span<const Case> cases) {
  for (const Case& each : cases) {
    SCOPED_TRACE(name_of(each.interlock));
    Watched rig;
    each.break_it(rig.interlocks);
    EXPECT_EQ(rig.now(10 * ms), each.interlock);
    EXPECT_THAT(rig.cause(10 * ms), HasSubstr(each.cause));
    each.restore_it(rig.interlocks);
    EXPECT_EQ(rig.now(10 * ms), Interlock::none) << rig.cause(10 * ms);
  }
}

TEST(Interlocks, EachIsBrokenByItsConditionAndHoldsAgainAfterwards) {
  expect_broken_and_restored(device_cases);
  expect_broken_and_restored(channel_cases);
  expect_broken_and_restored(daemon_cases);
}

TEST(Interlocks, LimitsThatAreNotConfiguredBreakNothing) {
  Watched rig{InterlockSettings()};
  rig.interlocks.cycle_late(1000 * ms);
  rig.interlocks.recorder(true);
  rig.interlocks.observer_restarted(true);
  Frame wild = good();
  wild.set(Channel::velocity, 1e9);
  rig.interlocks.frame(wild, 0b11, ms);
  EXPECT_EQ(rig.now(10'000 * ms), Interlock::none);
}

TEST(Interlocks, TemporaryFailuresBreakOnlyIfTheyPersist) {
  Watched rig;
  for (std::int64_t t = 0; t < 1000; t += 40) {
    rig.interlocks.frame(good(), 0, t * ms);
    rig.interlocks.read_result({Outcome::temporary, "checksum"}, t * ms);
    rig.interlocks.read_result({Outcome::no_data, ""}, (t + 10) * ms);
    EXPECT_EQ(rig.now((t + 30) * ms), Interlock::none);
    rig.interlocks.read_result({}, (t + 30) * ms);  // one good reading resets the time
  }
  rig.interlocks.read_result({Outcome::temporary, "checksum"}, 2000 * ms);
  rig.interlocks.write_result({}, 2050 * ms);  // a successful write does not count for reads
  rig.interlocks.frame(good(), 0, 2099 * ms);
  EXPECT_EQ(rig.now(2099 * ms), Interlock::none);
  EXPECT_EQ(rig.now(2100 * ms), Interlock::device_silent);
}

TEST(Interlocks, AChannelThatTheDeviceLacksIsNeverStale) {
  Watched rig;
  for (std::int64_t t = 0; t < 1000; t += 10) {
    Frame frame = good();
    frame.set(Channel::normal_load, 1.0);
    if (t > 100) frame.invalidate(Channel::normal_load);
    rig.interlocks.frame(frame, 0, t * ms);
    ASSERT_EQ(rig.now(t * ms), Interlock::none);
  }
}

TEST(Interlocks, ADeviceWithoutAFrameIsStale) {
  EXPECT_EQ(Interlocks(strict(), two_channels).broken(0).interlock, Interlock::stale_channel);
  Watched rig;
  EXPECT_EQ(rig.now(ms), Interlock::none);
  rig.interlocks.device_restored();
  EXPECT_EQ(rig.now(ms), Interlock::stale_channel);
  rig.interlocks.frame(good(), 0, ms);
  EXPECT_EQ(rig.now(ms), Interlock::none);
}

TEST(Interlocks, TheMostSeriousIsReported) {
  Watched rig;
  rig.interlocks.cycle_late(7 * ms);
  rig.interlocks.read_result({Outcome::lost, "gone"}, ms);
  EXPECT_EQ(rig.now(ms), Interlock::device_lost);
  rig.interlocks.signals({true, true});
  EXPECT_EQ(rig.now(ms), Interlock::emergency_stop);
}

}  // namespace
}  // namespace stickslip::daemon
