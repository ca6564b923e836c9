// SPDX-License-Identifier: Apache-2.0
// The real driver of the PhidgetBridge with the emulated bridge on a bus in this program.
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

/// Two load cells with sinusoidal loads in quadrature, and the history of their readings.
class SineWires final : public Wires {
 public:
  struct Sample {
    Channel channel;
    std::int64_t time_ns;
    double truth;
  };
  double truth(Channel channel, std::int64_t time_ns) override {
    const double quarter = channel == Channel::normal_load ? 0.25 : 0.0;
    const double turns = 0.7 * static_cast<double>(time_ns) * 1e-9;
    const double truth = overload * std::sin(2.0 * std::numbers::pi * (turns + quarter));
    samples.push_back({channel, time_ns, truth});
    return truth;
  }
  void drive(double, std::int64_t) override {}
  void enable(bool, std::int64_t) override {}

  std::vector<Sample> samples;
  double overload = 1.0;
};

/// The cells are on inputs 1 and 3; full load is at most 0.99 of the range.
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
  EmulatedPhidgetBridge::InjectedFaults injected() {
    EmulatedPhidgetBridge::InjectedFaults out;
    bus.between_calls([&] { out = bridge.injected(); });
    return out;
  }

  struct Readings {
    std::size_t input;  // 0: friction, 1: normal force
    Reading reading;
  };

  /// Readings of a duration.
  std::vector<Readings> readings(milliseconds time) {
    std::vector<Readings> out;
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

  /// Number of valid readings that differ from the measurement at their arrival or, with a late
  /// host, a few reports before.
  std::size_t wrong(const std::vector<Readings>& readings) {
    std::vector<SineWires::Sample> samples;
    bus.between_calls([&] { samples = wires.samples; });
    std::size_t wrong = 0;
    for (const Readings& one : readings) {
      if (!one.reading.valid) continue;
      const Channel channel = one.input == 0 ? Channel::friction_force : Channel::normal_load;
      const double gain = gain_of[one.input];
      int compared = 0;
      bool right = false;
      for (std::size_t i = samples.size(); i-- > 0 && compared < 8 && !right;) {
        if (samples[i].channel != channel || samples[i].time_ns > one.reading.time_ns) continue;
        ++compared;
        const double ratio =
            one.input == 0 ? (0.05 + 0.9 * samples[i].truth) / gain : 0.1 + 0.5 * samples[i].truth;
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
  SineWires wires;
  EmulatedPhidgetBridge bridge;
  PhidgetBridge gauge;
  bool first_is_friction = true;
  std::array<Reading, 2> now{};
  Result last;
  int temporary = 0;
};

std::size_t valid_ones(const std::vector<Bench::Readings>& readings) {
  return static_cast<std::size_t>(std::count_if(readings.begin(), readings.end(),
                                                [](const auto& one) { return one.reading.valid; }));
}

TEST(PhidgetBridgeOnABus, ReadingsAreAccurateToTheResolutionAtAllGains) {
  for (const int gain : {1, 8, 16, 32, 64, 128}) {
    SCOPED_TRACE(gain);
    Bench bench(gain);
    const Result opened = bench.gauge.open();
    ASSERT_TRUE(opened) << opened.message;
    EXPECT_THAT(bench.gauge.name(), HasSubstr("123456"));
    const auto readings = bench.readings(milliseconds(200));
    ASSERT_GT(valid_ones(readings), 30U);
    EXPECT_EQ(valid_ones(readings), readings.size());
    EXPECT_EQ(bench.wrong(readings), 0U);
    EXPECT_EQ(bench.gauge.losses().rejected, 0U);
  }
}

TEST(PhidgetBridgeOnABus, IsConfiguredByTheControlEndpoint) {
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
  const auto readings = bench.readings(milliseconds(200));
  EXPECT_GT(valid_ones(readings), 20U);
  EXPECT_EQ(bench.wrong(readings), 0U);
  bench.gauge.close();
  bench.bus.unplug(other);
}

TEST(PhidgetBridgeOnABus, GainBugOfOldFirmwareIsWorkedAround) {
  for (const int firmware : {100, 101}) {
    for (const int interval_ms : {8, 40}) {
      SCOPED_TRACE(interval_ms);
      Bench bench(128, interval_ms, 1, firmware);
      const Result opened = bench.gauge.open();
      ASSERT_TRUE(opened) << opened.message;
      const auto readings = bench.readings(milliseconds(250));
      EXPECT_GT(valid_ones(readings), 6U);
      EXPECT_EQ(bench.wrong(readings), 0U);
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
  auto readings = bench.readings(milliseconds(150));
  bench.set_faults({.missing = 0.2});
  const auto more = bench.readings(milliseconds(1600));
  bench.set_faults({});
  readings.insert(readings.end(), more.begin(), more.end());
  bench.readings(milliseconds(100));
  const auto injected = bench.injected();
  ASSERT_GT(injected.missing, 6U);
  // Missing reports are counted by elapsed time: each delay of the host by half an interval may
  // count.
  constexpr double half_interval_ns = 12e6;
  const double suspended =
      std::floor(static_cast<double>(bench.host.lost().count()) / half_interval_ns);
  EXPECT_NEAR(static_cast<double>(bench.gauge.losses().missing),
              static_cast<double>(injected.missing), suspended);
  EXPECT_EQ(bench.gauge.losses().rejected, 0U);
  EXPECT_EQ(bench.wrong(readings), 0U);
}

TEST(PhidgetBridgeOnABus, ShortReportsAreRejected) {
  Bench bench(128, 8, 4);
  ASSERT_TRUE(bench.gauge.open());
  bench.set_faults({.short_report = 0.2});
  const auto readings = bench.readings(milliseconds(700));
  bench.set_faults({});
  const auto injected = bench.injected();
  for (int i = 0; i < 40 && bench.gauge.losses().rejected < injected.short_report; ++i) {
    bench.readings(milliseconds(50));
  }
  ASSERT_GT(injected.short_report, 5U);
  EXPECT_EQ(bench.gauge.losses().rejected, injected.short_report);
  EXPECT_GT(bench.temporary, 0);
  EXPECT_EQ(bench.wrong(readings), 0U);
  EXPECT_GT(valid_ones(readings), 100U);
}

TEST(PhidgetBridgeOnABus, LastReadingStaysValidForALimitedTimeWithoutANewOne) {
  Bench bench(128, 40, 5);
  ASSERT_TRUE(bench.gauge.open());
  ASSERT_GT(valid_ones(bench.readings(milliseconds(200))), 4U);
  const Reading before = bench.now[0];
  bench.set_faults({.invalid = 1.0});
  bench.readings(milliseconds(10));  // reports in flight
  const auto readings = bench.readings(milliseconds(400));
  EXPECT_FALSE(bench.now[0].valid);
  EXPECT_FALSE(bench.now[1].valid);
  ASSERT_FALSE(readings.empty());
  EXPECT_GT(readings.front().reading.time_ns - before.time_ns, 70 * ms);
  EXPECT_EQ(valid_ones(readings), 0U);
  bench.set_faults({});
  const auto again = bench.readings(milliseconds(200));
  EXPECT_GT(valid_ones(again), 4U);
  EXPECT_EQ(bench.wrong(again), 0U);
  // Single ones are not reported.
  bench.set_faults({.invalid = 0.3});
  const auto some = bench.readings(milliseconds(400));
  EXPECT_EQ(bench.wrong(some), 0U);
}

TEST(PhidgetBridgeOnABus, OutOfRangeIsInvalidWhetherReportedOrNot) {
  Bench bench(128, 8, 6);
  ASSERT_TRUE(bench.gauge.open());
  ASSERT_GT(valid_ones(bench.readings(milliseconds(100))), 4U);
  bench.set_faults({.out_of_range = 1.0});
  bench.readings(milliseconds(20));
  auto readings = bench.readings(milliseconds(100));
  ASSERT_GT(readings.size(), 10U);
  EXPECT_EQ(valid_ones(readings), 0U);
  bench.set_faults({});
  bench.readings(milliseconds(20));
  EXPECT_GT(valid_ones(bench.readings(milliseconds(100))), 10U);
  // An overloaded cell without an error bit of the bridge.
  bench.bus.between_calls([&] { bench.wires.overload = 40.0; });
  bench.readings(milliseconds(20));
  readings = bench.readings(milliseconds(200));
  for (const auto& one : readings) {
    const double gain = one.input == 0 ? 128.0 : 1.0;
    if (one.reading.valid) {
      EXPECT_LE(std::abs(one.reading.value), 0.995 / gain);
    }
  }
  EXPECT_LT(valid_ones(readings), readings.size());
  EXPECT_EQ(bench.wrong(readings), 0U);
}

TEST(PhidgetBridgeOnABus, LostSettingsInvalidateReportsAndAreRestored) {
  Bench bench(128, 8, 7);
  ASSERT_TRUE(bench.gauge.open());
  bench.set_faults({.wrong_echo = 0.1});
  const auto readings = bench.readings(milliseconds(600));
  EXPECT_GT(bench.injected().wrong_echo, 3U);
  EXPECT_GE(bench.gauge.losses().rejected, bench.injected().wrong_echo - 1);
  EXPECT_EQ(bench.wrong(readings), 0U);
  bench.set_faults({});
  // Another program changes the settings.
  for (int round = 0; round < 5; ++round) {
    bench.bus.between_calls([&] { bench.bridge.out(1, Bytes{0x0F, 0x33, 0x33, 1, 0, 0, 0, 0}); });
    const auto more = bench.readings(milliseconds(120));
    EXPECT_EQ(bench.wrong(more), 0U);
    EXPECT_GT(valid_ones(more), 10U) << bench.last.message;
  }
  // A reset, as by a glitch of its supply.
  bench.bus.between_calls([&] { bench.bridge.reset(); });
  const auto after = bench.readings(milliseconds(200));
  EXPECT_EQ(bench.wrong(after), 0U);
  EXPECT_GT(valid_ones(after), 20U);
}

TEST(PhidgetBridgeOnABus, ReadingsAreInvalidWhileReportsAreMissing) {
  Bench bench(128, 8, 8);
  ASSERT_TRUE(bench.gauge.open());
  bench.readings(milliseconds(50));
  bench.set_faults({.silent = true});
  const auto start = steady_clock::now();
  bench.readings(milliseconds(500));
  EXPECT_LT(steady_clock::now() - start, milliseconds(900)) << "a read blocked";
  EXPECT_EQ(bench.last.outcome, Outcome::no_data);
  EXPECT_FALSE(bench.now[0].valid);
  bench.set_faults({});
  const auto readings = bench.readings(milliseconds(200));
  EXPECT_GT(valid_ones(readings), 20U);
  EXPECT_EQ(bench.wrong(readings), 0U);
  // Silence of half a second plus the wait of the last read.
  EXPECT_GE(bench.gauge.losses().missing, 500U / 8U - 1U);
  EXPECT_LE(bench.gauge.losses().missing, 720U / 8U);
}

TEST(PhidgetBridgeOnABus, SilentBridgeDoesNotOpen) {
  Bench bench(128, 8, 8);
  bench.set_faults({.silent = true});
  const Result opened = bench.gauge.open();
  EXPECT_EQ(opened.outcome, Outcome::temporary);
  EXPECT_THAT(opened.message, HasSubstr("does not confirm"));
  bench.set_faults({});
  EXPECT_TRUE(bench.gauge.open());
}

TEST(PhidgetBridgeOnABus, UnpluggedInAnyStateIsLostAndRecovers) {
  Bench bench(128, 8, 9, 101);
  std::mt19937_64 random(9);
  int in_open = 0;
  for (int round = 0; round < 6; ++round) {
    SCOPED_TRACE(round);
    const milliseconds when(round % 2 == 0 ? random() % 250 : 450);
    std::thread unplugger([&] {
      std::this_thread::sleep_for(when);
      bench.bus.unplug(bench.bridge);
    });
    const Result opened = bench.gauge.open();
    if (opened) {
      const auto readings = bench.readings(milliseconds(1000));
      EXPECT_EQ(bench.last.outcome, Outcome::lost) << bench.last.message;
      EXPECT_EQ(bench.wrong(readings), 0U);
    } else {
      ++in_open;
      EXPECT_EQ(opened.outcome, Outcome::lost) << opened.message;
    }
    unplugger.join();
    bench.gauge.close();
    EXPECT_EQ(bench.gauge.open().outcome, Outcome::lost);
    bench.bus.plug(bench.bridge, 2);
  }
  EXPECT_GT(in_open, 0);
  EXPECT_TRUE(bench.gauge.open());
}

TEST(PhidgetBridgeOnABus, DeniedPermissionReportsTheRemedy) {
  Bench bench;
  bench.bus.refuse_access(bench.bridge);
  const Result result = bench.gauge.open();
  EXPECT_EQ(result.outcome, Outcome::needs_attention);
  EXPECT_THAT(result.message, HasSubstr("udev"));
  const auto found = drivers::find_phidget_bridge();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_THAT(found[0].problem, HasSubstr("udev"));
}

TEST(PhidgetBridgeOnABus, NewerVersionIsRejected) {
  Bench bench(128, 8, 1, 200);
  const Result result = bench.gauge.open();
  EXPECT_EQ(result.outcome, Outcome::needs_attention);
  EXPECT_THAT(result.message, HasSubstr("1046_1"));
  ASSERT_EQ(drivers::find_phidget_bridge().size(), 1U);
  EXPECT_THAT(drivers::find_phidget_bridge()[0].problem, HasSubstr("1046_1"));
}

/// The only bridge on the bus of `bench`.
class OtherBridge {
 public:
  OtherBridge(Bench& bench, const EmulatedPhidgetBridge::Options& options)
      : bench_(bench), bridge_(options, bench.wires, [&bench] { return bench.clock.now_ns(); }) {
    bench_.bus.unplug(bench_.bridge);
    bench_.bus.plug(bridge_, 1);
  }
  ~OtherBridge() {
    bench_.gauge.close();
    bench_.bus.unplug(bridge_);
  }

 private:
  Bench& bench_;
  EmulatedPhidgetBridge bridge_;
};

TEST(PhidgetBridgeOnABus, ReleaseOneIsVersionOne) {
  Bench bench;
  auto options = bridge_options(128, 1, 100);
  options.release = 0x0001;
  const OtherBridge other(bench, options);
  EXPECT_THAT(drivers::find_phidget_bridge().front().name, HasSubstr("firmware 1.00"));
  const Result opened = bench.gauge.open();
  ASSERT_TRUE(opened) << opened.message;
  const auto readings = bench.readings(milliseconds(200));
  EXPECT_GT(valid_ones(readings), 20U);
  EXPECT_EQ(bench.wrong(readings), 0U);
}

TEST(PhidgetBridgeOnABus, UnknownReleaseIsNotCalledAVersion) {
  Bench bench;
  auto options = bridge_options(128, 1, 102);
  options.release = 0;
  const OtherBridge other(bench, options);
  const Result opened = bench.gauge.open();
  EXPECT_EQ(opened.outcome, Outcome::needs_attention);
  EXPECT_THAT(opened.message, HasSubstr("version cannot be determined"));
  const auto found = drivers::find_phidget_bridge();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_THAT(found[0].name, testing::Not(HasSubstr("0.00")));
  EXPECT_THAT(found[0].problem, HasSubstr("version cannot be determined"));
}

// Whether a firmware repeats the requested interval is not published.
TEST(PhidgetBridgeOnABus, IntervalIsThatOfTheBoardAndReported) {
  Bench bench(128, 8);
  auto options = bridge_options(128, 1, 102);
  options.own_interval_ms = 40;
  const OtherBridge other(bench, options);
  const Result opened = bench.gauge.open();
  ASSERT_TRUE(opened) << opened.message;
  EXPECT_EQ(bench.gauge.remark(), "measures every 40 ms, 8 ms was requested");
  const auto readings = bench.readings(milliseconds(400));
  EXPECT_GT(valid_ones(readings), 8U);
  EXPECT_EQ(bench.wrong(readings), 0U);
  // Four of five would be missing by the requested interval.
  const auto suspended = static_cast<std::uint64_t>(bench.host.worst_ns() / (40 * ms));
  EXPECT_LE(bench.gauge.losses().missing, 1U + suspended);
}

TEST(PhidgetBridgeOnABus, RequestedIntervalIsAssumedIfNoneIsStated) {
  Bench bench(128, 24);
  auto options = bridge_options(128, 1, 102);
  options.states_interval = false;
  const OtherBridge other(bench, options);
  const Result opened = bench.gauge.open();
  ASSERT_TRUE(opened) << opened.message;
  EXPECT_EQ(bench.gauge.remark(), "states no valid interval; 24 ms is assumed");
  const auto readings = bench.readings(milliseconds(300));
  EXPECT_GT(valid_ones(readings), 8U);
  EXPECT_EQ(bench.wrong(readings), 0U);
}

TEST(PhidgetBridgeOnABus, RequestedIntervalNeedsNoRemark) {
  Bench bench(128, 40);
  ASSERT_TRUE(bench.gauge.open());
  EXPECT_EQ(bench.gauge.remark(), "");
}

TEST(PhidgetBridgeOnABus, AnotherBridgeInMidRunIsRefused) {
  Bench bench;
  ASSERT_TRUE(bench.gauge.open());
  bench.gauge.close();
  {
    auto options = bridge_options(128, 1, 102);
    options.serial = "654321";
    const OtherBridge other(bench, options);
    const Result opened = bench.gauge.open();
    EXPECT_EQ(opened.outcome, Outcome::needs_attention);
    EXPECT_THAT(opened.message, HasSubstr("123456 is attached; present: 654321"));
    EXPECT_THAT(opened.message, HasSubstr("The run began with it"));
  }
  bench.bus.plug(bench.bridge, 2);
  EXPECT_TRUE(bench.gauge.open());
}

/// All faults at random: every valid reading is correct.
TEST(PhidgetBridgeOnABus, FaultCampaignYieldsNoWrongReading) {
  for (std::uint64_t seed = 20; seed < 23; ++seed) {
    SCOPED_TRACE(seed);
    Bench bench(64, 8, seed, seed % 2 == 0 ? 102 : 101);
    ASSERT_TRUE(bench.gauge.open());
    std::mt19937_64 random(seed);
    const auto chance = [&random](double most) {
      return random() % 2 == 0 ? 0.0 : std::uniform_real_distribution<double>(0.0, most)(random);
    };
    std::vector<Bench::Readings> readings;
    for (int round = 0; round < 6; ++round) {
      bench.set_faults({.missing = chance(0.2),
                        .short_report = chance(0.2),
                        .invalid = chance(0.3),
                        .out_of_range = chance(0.2),
                        .wrong_echo = chance(0.1),
                        .silent = random() % 5 == 0});
      const auto more = bench.readings(milliseconds(60));
      readings.insert(readings.end(), more.begin(), more.end());
      ASSERT_NE(bench.last.outcome, Outcome::lost) << bench.last.message;
      ASSERT_NE(bench.last.outcome, Outcome::fatal);
    }
    bench.set_faults({});
    bench.readings(milliseconds(400));
    const auto after = bench.readings(milliseconds(80));
    EXPECT_GT(valid_ones(after), 8U);
    readings.insert(readings.end(), after.begin(), after.end());
    EXPECT_EQ(bench.wrong(readings), 0U) << "of " << readings.size();
  }
}

}  // namespace
}  // namespace stickslip::emulated
