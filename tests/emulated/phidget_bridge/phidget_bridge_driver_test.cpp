// The real driver of the PhidgetBridge, unchanged, against the emulated bridge on a bus inside this
// program.
#include "drivers/phidget_bridge/phidget_bridge.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <cmath>
#include <numbers>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "tests/emulated/attach/emulated_hidapi.h"
#include "tests/emulated/attach/host_watch.h"
#include "tests/emulated/phidget_bridge/emulated_phidget_bridge.h"

namespace stickslip::emulated {
namespace {

using drivers::Outcome;
using drivers::PhidgetBridge;
using drivers::Reading;
using drivers::Result;
using std::chrono::milliseconds;
using std::chrono::steady_clock;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr std::int64_t ms = 1'000'000;

/// Two cells a quarter turn apart, and what was asked for when.
class Turning final : public Wires {
 public:
  struct Asked {
    Channel channel;
    std::int64_t time_ns;
    double truth;
  };
  double truth(Channel channel, std::int64_t time_ns) override {
    const double quarter = channel == Channel::normal_load ? 0.25 : 0.0;
    const double turns = 0.7 * static_cast<double>(time_ns) * 1e-9;
    const double truth = overload * std::sin(2.0 * std::numbers::pi * (turns + quarter));
    asked.push_back({channel, time_ns, truth});
    return truth;
  }
  void drive(double, std::int64_t) override {}
  void enable(bool, std::int64_t) override {}

  std::vector<Asked> asked;
  double overload = 1.0;
};

/// The cells hang on inputs 1 and 3; full load is 0.99 of what the gain takes, and less.
EmulatedPhidgetBridge::Options bridge_options(int gain, std::uint64_t seed, int firmware) {
  EmulatedPhidgetBridge::Options out;
  out.seed = seed;
  out.firmware = firmware;
  out.sensors[1] = Sensor{Channel::friction_force, 0.9 / gain, 0.05 / gain};
  out.sensors[3] = Sensor{Channel::normal_load, 0.5, 0.1};
  return out;
}

config::BenchInputs inputs(int gain) {
  config::BenchInputs out;
  out[index_of(Channel::friction_force)] = {"phidget_bridge", "1", 10.0, false, gain};
  out[index_of(Channel::normal_load)] = {"phidget_bridge", "3", 10.0, false, 1};
  return out;
}

struct Bench {
  explicit Bench(int gain = 128, int interval_ms = 8, std::uint64_t seed = 1, int firmware = 102)
      : gain_of{gain, 1},
        bridge(bridge_options(gain, seed, firmware), wires, [this] { return clock.now_ns(); }),
        gauge({.serial = {}, .interval_ms = interval_ms}, inputs(gain), clock) {
    bus.plug(bridge, 1);
    first_is_friction = gauge.inputs()[0].name == "1";
  }
  ~Bench() {
    gauge.close();
    EXPECT_EQ(bus.open_handles(), 0);
    EXPECT_THAT(bus.misuses(), IsEmpty());
  }

  void set_faults(const EmulatedPhidgetBridge::Faults& faults) {
    bus.between_calls([&] { bridge.faults = faults; });
  }
  EmulatedPhidgetBridge::Struck struck() {
    EmulatedPhidgetBridge::Struck out;
    bus.between_calls([&] { out = bridge.struck(); });
    return out;
  }

  struct Told {
    std::size_t input;  // 0: friction, 1: normal force
    Reading reading;
  };

  /// What is told for so long.
  std::vector<Told> readings(milliseconds time) {
    std::vector<Told> out;
    const Interval interval(host, time);
    while (!interval.over()) {
      const auto before = now;
      last = gauge.read(now);
      if (last) {
        for (std::size_t i = 0; i < now.size(); ++i) {
          if (now[i].time_ns != before[i].time_ns) {
            out.push_back({first_is_friction ? i : 1 - i, now[i]});
          }
        }
      } else if (last.outcome == Outcome::temporary) {
        ++temporary;
      } else if (last.outcome != Outcome::no_data) {
        break;
      }
    }
    return out;
  }

  /// How many valid readings are not what was measured when they came, or, by a host that
  /// is late, a few reports before.
  std::size_t wrong(const std::vector<Told>& told) {
    std::vector<Turning::Asked> asked;
    bus.between_calls([&] { asked = wires.asked; });
    std::size_t wrong = 0;
    for (const Told& one : told) {
      if (!one.reading.valid) continue;
      const Channel channel = one.input == 0 ? Channel::friction_force : Channel::normal_load;
      const double gain = gain_of[one.input];
      int looked_at = 0;
      bool right = false;
      for (std::size_t i = asked.size(); i-- > 0 && looked_at < 8 && !right;) {
        if (asked[i].channel != channel || asked[i].time_ns > one.reading.time_ns) continue;
        ++looked_at;
        const double ratio =
            one.input == 0 ? (0.05 + 0.9 * asked[i].truth) / gain : 0.1 + 0.5 * asked[i].truth;
        right = std::abs(one.reading.value - ratio) <= 0.500001 / 8388608.0 / gain;
      }
      if (!right) ++wrong;
    }
    return wrong;
  }

  HostWatch host;
  std::array<int, 2> gain_of;
  drivers::MonotonicHostClock clock;
  EmulatedBus bus;
  Turning wires;
  EmulatedPhidgetBridge bridge;
  PhidgetBridge gauge;
  bool first_is_friction = true;
  std::array<Reading, 2> now{};
  Result last;
  int temporary = 0;
};

std::size_t valid_ones(const std::vector<Bench::Told>& told) {
  return static_cast<std::size_t>(
      std::count_if(told.begin(), told.end(), [](const auto& one) { return one.reading.valid; }));
}

TEST(PhidgetBridgeOnABus, ReadingsAreRightToTheStepAtAllGains) {
  for (const int gain : {1, 8, 16, 32, 64, 128}) {
    SCOPED_TRACE(gain);
    Bench bench(gain);
    const Result opened = bench.gauge.open();
    ASSERT_TRUE(opened) << opened.message;
    EXPECT_THAT(bench.gauge.name(), HasSubstr("123456"));
    const auto told = bench.readings(milliseconds(200));
    ASSERT_GT(valid_ones(told), 30U);
    EXPECT_EQ(valid_ones(told), told.size());
    EXPECT_EQ(bench.wrong(told), 0U);
    EXPECT_EQ(bench.gauge.losses().rejected, 0U);
  }
}

TEST(PhidgetBridgeOnABus, SetByReportsOfTheControlEndpointAsWell) {
  auto options = bridge_options(64, 1, 102);
  options.out_endpoint = false;
  options.output_report_bytes = 5;
  options.input_report_bytes = 18;
  Bench bench(64);
  bench.bus.unplug(bench.bridge);
  EmulatedPhidgetBridge other(options, bench.wires, [&] { return bench.clock.now_ns(); });
  bench.bus.plug(other, 1);
  const Result opened = bench.gauge.open();
  ASSERT_TRUE(opened) << opened.message;
  const auto told = bench.readings(milliseconds(200));
  EXPECT_GT(valid_ones(told), 20U);
  EXPECT_EQ(bench.wrong(told), 0U);
  bench.gauge.close();
  bench.bus.unplug(other);
}

TEST(PhidgetBridgeOnABus, OldFirmwareIsHelpedOverItsGain) {
  for (const int firmware : {100, 101}) {
    for (const int interval_ms : {8, 40}) {
      SCOPED_TRACE(interval_ms);
      Bench bench(128, interval_ms, 1, firmware);
      const Result opened = bench.gauge.open();
      ASSERT_TRUE(opened) << opened.message;
      const auto told = bench.readings(milliseconds(250));
      EXPECT_GT(valid_ones(told), 6U);
      EXPECT_EQ(bench.wrong(told), 0U);
      bench.bus.between_calls([&] {
        EXPECT_FALSE(bench.bridge.enabled(0));
        EXPECT_EQ(bench.bridge.interval_ms(), interval_ms);
      });
    }
  }
}

TEST(PhidgetBridgeOnABus, MissingReportsAreCountedExactly) {
  Bench bench(128, 24, 3);
  ASSERT_TRUE(bench.gauge.open());
  auto told = bench.readings(milliseconds(150));
  bench.set_faults({.missing = 0.2});
  const auto more = bench.readings(milliseconds(1600));
  bench.set_faults({});
  told.insert(told.end(), more.begin(), more.end());
  bench.readings(milliseconds(100));
  const auto struck = bench.struck();
  ASSERT_GT(struck.missing, 6U);
  // What is missing shows by the time that passes: nobody can tell it from a host that stood still.
  constexpr double interval_ns = 24e6;
  const double stood_still = std::floor(static_cast<double>(bench.host.worst_ns()) / interval_ns);
  EXPECT_NEAR(static_cast<double>(bench.gauge.losses().missing),
              static_cast<double>(struck.missing), stood_still);
  EXPECT_EQ(bench.gauge.losses().rejected, 0U);
  EXPECT_EQ(bench.wrong(told), 0U);
}

TEST(PhidgetBridgeOnABus, ShortReportsAreRejected) {
  Bench bench(128, 8, 4);
  ASSERT_TRUE(bench.gauge.open());
  bench.set_faults({.short_report = 0.2});
  const auto told = bench.readings(milliseconds(700));
  bench.set_faults({});
  const auto struck = bench.struck();
  for (int i = 0; i < 40 && bench.gauge.losses().rejected < struck.short_report; ++i) {
    bench.readings(milliseconds(50));
  }
  ASSERT_GT(struck.short_report, 5U);
  EXPECT_EQ(bench.gauge.losses().rejected, struck.short_report);
  EXPECT_GT(bench.temporary, 0);
  EXPECT_EQ(bench.wrong(told), 0U);
  EXPECT_GT(valid_ones(told), 100U);
}

TEST(PhidgetBridgeOnABus, ReportsWithoutAReadingLeaveTheLastOneForAWhile) {
  Bench bench(128, 40, 5);
  ASSERT_TRUE(bench.gauge.open());
  ASSERT_GT(valid_ones(bench.readings(milliseconds(200))), 4U);
  const Reading before = bench.now[0];
  bench.set_faults({.invalid = 1.0});
  bench.readings(milliseconds(10));  // what is under way
  const auto told = bench.readings(milliseconds(400));
  EXPECT_FALSE(bench.now[0].valid);
  EXPECT_FALSE(bench.now[1].valid);
  ASSERT_FALSE(told.empty());
  EXPECT_GT(told.front().reading.time_ns - before.time_ns, 70 * ms);
  EXPECT_EQ(valid_ones(told), 0U);
  bench.set_faults({});
  const auto again = bench.readings(milliseconds(200));
  EXPECT_GT(valid_ones(again), 4U);
  EXPECT_EQ(bench.wrong(again), 0U);
  // One now and then is not worth a word.
  bench.set_faults({.invalid = 0.3});
  const auto some = bench.readings(milliseconds(400));
  EXPECT_EQ(bench.wrong(some), 0U);
}

TEST(PhidgetBridgeOnABus, OutOfRangeIsNotValidHoweverItIsTold) {
  Bench bench(128, 8, 6);
  ASSERT_TRUE(bench.gauge.open());
  ASSERT_GT(valid_ones(bench.readings(milliseconds(100))), 4U);
  bench.set_faults({.out_of_range = 1.0});
  bench.readings(milliseconds(20));
  auto told = bench.readings(milliseconds(100));
  ASSERT_GT(told.size(), 10U);
  EXPECT_EQ(valid_ones(told), 0U);
  bench.set_faults({});
  bench.readings(milliseconds(20));
  EXPECT_GT(valid_ones(bench.readings(milliseconds(100))), 10U);
  // A cell that is bent too far, and a bridge that does not say so.
  bench.bus.between_calls([&] { bench.wires.overload = 40.0; });
  bench.readings(milliseconds(20));
  told = bench.readings(milliseconds(200));
  for (const auto& one : told) {
    const double gain = one.input == 0 ? 128.0 : 1.0;
    if (one.reading.valid) {
      EXPECT_LE(std::abs(one.reading.value), 0.995 / gain);
    }
  }
  EXPECT_LT(valid_ones(told), told.size());
  EXPECT_EQ(bench.wrong(told), 0U);
}

TEST(PhidgetBridgeOnABus, WhatItWasNotSetToIsNotBelievedAndIsSetAgain) {
  Bench bench(128, 8, 7);
  ASSERT_TRUE(bench.gauge.open());
  bench.set_faults({.wrong_echo = 0.1});
  const auto told = bench.readings(milliseconds(600));
  EXPECT_GT(bench.struck().wrong_echo, 3U);
  EXPECT_GE(bench.gauge.losses().rejected, bench.struck().wrong_echo - 1);
  EXPECT_EQ(bench.wrong(told), 0U);
  bench.set_faults({});
  // Another program sets it to something else.
  for (int round = 0; round < 5; ++round) {
    bench.bus.between_calls([&] { bench.bridge.out(1, Bytes{0x0F, 0x33, 0x33, 1, 0, 0, 0, 0}); });
    const auto more = bench.readings(milliseconds(120));
    EXPECT_EQ(bench.wrong(more), 0U);
    EXPECT_GT(valid_ones(more), 10U) << bench.last.message;
  }
  // It was reset, as by a glitch of its supply.
  bench.bus.between_calls([&] { bench.bridge.reset(); });
  const auto after = bench.readings(milliseconds(200));
  EXPECT_EQ(bench.wrong(after), 0U);
  EXPECT_GT(valid_ones(after), 20U);
}

TEST(PhidgetBridgeOnABus, SilenceEndsValidityAndItGoesOnAfterwards) {
  Bench bench(128, 8, 8);
  ASSERT_TRUE(bench.gauge.open());
  bench.readings(milliseconds(50));
  bench.set_faults({.silent = true});
  const auto begun = steady_clock::now();
  bench.readings(milliseconds(500));
  EXPECT_LT(steady_clock::now() - begun, milliseconds(900)) << "a read waited";
  EXPECT_EQ(bench.last.outcome, Outcome::no_data);
  EXPECT_FALSE(bench.now[0].valid);
  bench.set_faults({});
  const auto told = bench.readings(milliseconds(200));
  EXPECT_GT(valid_ones(told), 20U);
  EXPECT_EQ(bench.wrong(told), 0U);
  // It was silent for half a second, and for as long as the last read waited.
  EXPECT_GE(bench.gauge.losses().missing, 500U / 8U - 1U);
  EXPECT_LE(bench.gauge.losses().missing, 720U / 8U);
}

TEST(PhidgetBridgeOnABus, ASilentBridgeIsNotOpened) {
  Bench bench(128, 8, 8);
  bench.set_faults({.silent = true});
  const Result opened = bench.gauge.open();
  EXPECT_EQ(opened.outcome, Outcome::temporary);
  EXPECT_THAT(opened.message, HasSubstr("does not report"));
  bench.set_faults({});
  EXPECT_TRUE(bench.gauge.open());
}

TEST(PhidgetBridgeOnABus, UnpluggedInAnyStateItIsLostAndComesBack) {
  Bench bench(128, 8, 9, 101);
  std::mt19937_64 luck(9);
  int in_open = 0;
  for (int round = 0; round < 6; ++round) {
    SCOPED_TRACE(round);
    const milliseconds when(round % 2 == 0 ? luck() % 250 : 450);
    std::thread puller([&] {
      std::this_thread::sleep_for(when);
      bench.bus.unplug(bench.bridge);
    });
    const Result opened = bench.gauge.open();
    if (opened) {
      const auto told = bench.readings(milliseconds(1000));
      EXPECT_EQ(bench.last.outcome, Outcome::lost) << bench.last.message;
      EXPECT_EQ(bench.wrong(told), 0U);
    } else {
      ++in_open;
      EXPECT_EQ(opened.outcome, Outcome::lost) << opened.message;
    }
    puller.join();
    bench.gauge.close();
    EXPECT_EQ(bench.gauge.open().outcome, Outcome::lost);
    bench.bus.plug(bench.bridge, 2);
  }
  EXPECT_GT(in_open, 0);
  EXPECT_TRUE(bench.gauge.open());
}

TEST(PhidgetBridgeOnABus, WithoutPermissionItSaysWhatToDo) {
  Bench bench;
  bench.bus.refuse_access(bench.bridge);
  const Result result = bench.gauge.open();
  EXPECT_EQ(result.outcome, Outcome::needs_attention);
  EXPECT_THAT(result.message, HasSubstr("udev"));
  const auto found = drivers::find_phidget_bridge();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_THAT(found[0].trouble, HasSubstr("udev"));
}

TEST(PhidgetBridgeOnABus, TheNewerOneOfTheNameIsRefused) {
  Bench bench(128, 8, 1, 200);
  const Result result = bench.gauge.open();
  EXPECT_EQ(result.outcome, Outcome::needs_attention);
  EXPECT_THAT(result.message, HasSubstr("1046_1"));
  ASSERT_EQ(drivers::find_phidget_bridge().size(), 1U);
  EXPECT_THAT(drivers::find_phidget_bridge()[0].trouble, HasSubstr("1046_1"));
}

/// Everything at once, by seeded chance: a valid reading is a right one, whatever happens.
TEST(PhidgetBridgeOnABus, ACampaignOfFaultsMakesNoReadingWrong) {
  for (std::uint64_t seed = 20; seed < 23; ++seed) {
    SCOPED_TRACE(seed);
    Bench bench(64, 8, seed, seed % 2 == 0 ? 102 : 101);
    ASSERT_TRUE(bench.gauge.open());
    std::mt19937_64 luck(seed);
    const auto chance = [&luck](double most) {
      return luck() % 2 == 0 ? 0.0 : std::uniform_real_distribution<double>(0.0, most)(luck);
    };
    std::vector<Bench::Told> told;
    for (int round = 0; round < 6; ++round) {
      bench.set_faults({.missing = chance(0.2),
                        .short_report = chance(0.2),
                        .invalid = chance(0.3),
                        .out_of_range = chance(0.2),
                        .wrong_echo = chance(0.1),
                        .silent = luck() % 5 == 0});
      const auto more = bench.readings(milliseconds(60));
      told.insert(told.end(), more.begin(), more.end());
      ASSERT_NE(bench.last.outcome, Outcome::lost) << bench.last.message;
      ASSERT_NE(bench.last.outcome, Outcome::fatal);
    }
    bench.set_faults({});
    bench.readings(milliseconds(400));
    const auto after = bench.readings(milliseconds(80));
    EXPECT_GT(valid_ones(after), 8U);
    told.insert(told.end(), after.begin(), after.end());
    EXPECT_EQ(bench.wrong(told), 0U) << "of " << told.size();
  }
}

}  // namespace
}  // namespace stickslip::emulated
