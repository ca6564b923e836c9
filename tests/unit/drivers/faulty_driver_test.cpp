// SPDX-License-Identifier: Apache-2.0
#include "drivers/faults/faulty_driver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <random>

#include "config/rig.h"
#include "drivers/factory/make_driver.h"

namespace stickslip::drivers {
namespace {

using config::Fault;
using config::FaultKind;

/// The same cases in every run, unless others are requested.
const int seeded = setenv("RC_PARAMS", "seed=20260102 max_success=200", 0);

constexpr double period_s = 1.0e-3;
constexpr std::int64_t period_ns = 1'000'000;
constexpr std::int64_t origin_ns = 1'700'000'000'000'000'000;
constexpr std::uint64_t first_sequence = 1000;

bool same_bits(const Frame& a, const Frame& b) {
  bool same = a.time_ns == b.time_ns && a.sequence == b.sequence && a.valid == b.valid &&
              a.age_us == b.age_us;
  for (std::size_t i = 0; i < channel_count; ++i) {
    same = same &&
           std::bit_cast<std::uint64_t>(a.value[i]) == std::bit_cast<std::uint64_t>(b.value[i]);
  }
  return same;
}

/// Frame with this number: every channel has another value in [-1, 1).
Frame device_frame(std::uint64_t number, std::uint8_t channels = 0b111111) {
  Frame frame;
  frame.time_ns = origin_ns + static_cast<std::int64_t>(number) * period_ns;
  frame.sequence = first_sequence + number;
  const Chance chance(99, 0);
  for (const Channel channel : all_channels) {
    if (((channels >> index_of(channel)) & 1U) == 0) continue;
    frame.set(channel, 2.0 * chance.uniform(Purpose::moment, number, index_of(channel)) - 1.0);
  }
  frame.age_us[index_of(Channel::normal_load)] = frame.has(Channel::normal_load) ? 250 : 0;
  return frame;
}

/// Calls of a device, and its behaviour.
struct Device {
  bool paced = false;
  std::uint8_t channels = 0b111111;
  std::uint64_t end = ~0ULL;                 // frames; then end_of_data
  std::map<std::uint64_t, Outcome> instead;  // by read: outcome instead of a frame
  Signals signals;
  int opens = 0, starts = 0, stops = 0, closes = 0;
  std::uint64_t reads = 0, frames = 0;
  std::vector<Actuation> writes;
};

class DeviceDriver final : public Driver {
 public:
  explicit DeviceDriver(Device& device) : device_(device) {
    description_.name = "device";
    description_.paced = device.paced;
    description_.can_drive = true;
    description_.channels = device.channels;
  }
  Result open() override { return ++device_.opens, Result{}; }
  Result start() override {
    running_ = true;
    return ++device_.starts, Result{};
  }
  Result read(Frame& frame) override {
    if (!running_) return {Outcome::fatal, "read of a device that is not started"};
    const auto other = device_.instead.find(device_.reads++);
    if (other != device_.instead.end()) return {other->second, "of the device"};
    if (device_.frames == device_.end) return {Outcome::end_of_data, ""};
    frame = device_frame(device_.frames++, device_.channels);
    return {};
  }
  Result write(const Actuation& actuation) override {
    device_.writes.push_back(actuation);
    return {};
  }
  void stop() noexcept override {
    running_ = false;
    ++device_.stops;
  }
  void close() noexcept override {
    running_ = false;
    ++device_.closes;
  }
  const Description& description() const override { return description_; }
  Signals signals() const noexcept override { return device_.signals; }

 private:
  Device& device_;
  Description description_;
  bool running_ = false;
};

/// Advances only by sleeping or by the test.
class TestClock final : public HostClock {
 public:
  std::int64_t now_ns() override { return now; }
  void sleep_until(std::int64_t due_ns) override {
    slept += std::max<std::int64_t>(0, due_ns - now);
    now = std::max(now, due_ns);
  }
  std::int64_t now = 123'456'789;
  std::int64_t slept = 0;
};

Fault fault(FaultKind kind, double at_s, std::optional<double> duration_s, double amount = 0.0) {
  Fault out;
  out.kind = kind;
  out.from_s = out.to_s = at_s;
  out.duration_s = kind == FaultKind::stall ? amount : duration_s;
  out.amount = amount;
  return out;
}

Fault on(Channel channel, Fault out) {
  out.channel = channel;
  return out;
}

Fault with_probability(double probability, Fault out) {
  out.probability = probability;
  return out;
}

struct Reading {
  Outcome outcome = Outcome::ok;
  std::string message;
  Frame frame;  // if the outcome is ok
  Signals signals;
};

bool same(const Reading& a, const Reading& b) {
  return a.outcome == b.outcome && a.message == b.message && same_bits(a.frame, b.frame) &&
         a.signals.emergency_stop == b.signals.emergency_stop &&
         a.signals.amplifier_fault == b.signals.amplifier_fault &&
         a.signals.lost_device == b.signals.lost_device;
}

/// A device with a fault script.
struct Bench {
  explicit Bench(std::vector<Fault> faults, Device with = {}, std::uint64_t seed = 1,
                 double period = period_s, double speed = 1.0)
      : device(std::move(with)),
        driver(std::make_unique<DeviceDriver>(device),
               config::FaultScript{
                   .file = "some/test.toml", .text = "", .seed = seed, .faults = std::move(faults)},
               Pace{period, speed}, clock) {}

  Bench& run() {
    EXPECT_TRUE(driver.open());
    EXPECT_TRUE(driver.start());
    return *this;
  }

  Reading read() {
    Reading out;
    Frame frame;
    frame.sequence = 77;
    const Result result = driver.read(frame);
    out.outcome = result.outcome;
    out.message = result.message;
    out.signals = driver.signals();
    if (result) {
      out.frame = frame;
    } else {
      EXPECT_EQ(frame.sequence, 77U) << "modified without a frame";
    }
    EXPECT_TRUE(driver.account().balances());
    return out;
  }

  std::vector<Reading> read(int count) {
    std::vector<Reading> out;
    for (int i = 0; i < count; ++i) out.push_back(read());
    return out;
  }

  /// Those with a frame.
  std::vector<Frame> frames(int reads) {
    std::vector<Frame> out;
    for (const Reading& each : read(reads)) {
      if (each.outcome == Outcome::ok) out.push_back(each.frame);
    }
    return out;
  }

  Device device;
  std::shared_ptr<TestClock> clock = std::make_shared<TestClock>();
  FaultyDriver driver;
};

bool is_device_frame(const Frame& frame) {
  return same_bits(frame, device_frame(frame.sequence - first_sequence));
}

// Without faults.

RC_GTEST_PROP(FaultyDriver, EmptyScriptIsTransparent, ()) {
  Device device;
  device.paced = *rc::gen::arbitrary<bool>();
  device.channels = static_cast<std::uint8_t>(*rc::gen::inRange(0, 64));
  device.end = *rc::gen::inRange<std::uint64_t>(0, 60);
  device.signals = {*rc::gen::arbitrary<bool>(), *rc::gen::arbitrary<bool>(),
                    *rc::gen::element<const char*>(nullptr, "the bridge is disconnected")};
  for (std::uint64_t i = 0; i < 60; ++i) {
    if (*rc::gen::inRange(0, 6) == 0) {
      device.instead[i] = *rc::gen::element(Outcome::no_data, Outcome::temporary, Outcome::lost,
                                            Outcome::fatal, Outcome::needs_attention);
    }
  }
  Device bare_device = device;
  DeviceDriver bare(bare_device);
  Bench bench({}, device);
  bench.driver.open();
  bench.driver.start();
  bare.open();
  bare.start();
  RC_ASSERT(bench.driver.description().name == bare.description().name);
  RC_ASSERT(bench.driver.description().channels == bare.description().channels);
  RC_ASSERT(bench.driver.description().paced == bare.description().paced);
  for (int i = 0; i < 70; ++i) {
    if (*rc::gen::inRange(0, 10) == 0) {
      bench.driver.stop();
      bare.stop();
    }
    Frame one;
    Frame two;
    const Result a = bench.driver.read(one);
    const Result b = bare.read(two);
    RC_ASSERT(a.outcome == b.outcome);
    RC_ASSERT(std::string(a.message) == b.message);
    RC_ASSERT(same_bits(one, two));
    const Actuation actuation{0.001 * i, i % 2 == 0};
    RC_ASSERT(bench.driver.write(actuation).outcome == bare.write(actuation).outcome);
    RC_ASSERT(bench.driver.signals().emergency_stop == bare.signals().emergency_stop);
    RC_ASSERT(bench.driver.signals().amplifier_fault == bare.signals().amplifier_fault);
    RC_ASSERT(bench.driver.signals().lost_device == bare.signals().lost_device);
  }
  RC_ASSERT(bench.device.reads == bare_device.reads);
  RC_ASSERT(bench.device.writes.size() == bare_device.writes.size());
  RC_ASSERT(bench.clock->slept == 0);
}

TEST(FaultyDriver, RandomCasesAreSeeded) { EXPECT_EQ(seeded, 0); }

// Faults of channels, each active from the tenth to the thirtieth of fifty frames.

constexpr double begin_s = 0.010;
constexpr double length_s = 0.020;

bool is_active(std::size_t frame) { return frame >= 10 && frame < 30; }

/// Fifty frames with one fault; all channels but those of `expected` are unchanged.
template <class Expected>
void expect_channel(const Fault& of, Channel channel, const Expected& expected) {
  Bench bench({on(channel, of)});
  const auto frames = bench.run().frames(50);
  ASSERT_EQ(frames.size(), 50U);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    Frame want = device_frame(i);
    if (is_active(i)) want.value[index_of(channel)] = expected(i);
    if (std::isnan(want[channel])) {
      EXPECT_TRUE(std::isnan(frames[i][channel])) << i;
      want.value[index_of(channel)] = frames[i][channel];
    }
    EXPECT_TRUE(same_bits(frames[i], want)) << i;
  }
  EXPECT_EQ(bench.driver.applied().at(0).occurrences, 1U);
}

TEST(FaultyDriver, HoldsAStuckValue) {
  expect_channel(fault(FaultKind::stick, begin_s, length_s), Channel::velocity,
                 [](std::size_t) { return device_frame(10)[Channel::velocity]; });
}

TEST(FaultyDriver, AddsADrift) {
  expect_channel(fault(FaultKind::drift, begin_s, length_s, -3.0), Channel::normal_load,
                 [](std::size_t i) {
                   return device_frame(i)[Channel::normal_load] -
                          3.0 * (static_cast<double>((i - 10) * 1000000) * 1.0e-9);
                 });
}

TEST(FaultyDriver, Saturates) {
  expect_channel(fault(FaultKind::saturate, begin_s, length_s, 0.25), Channel::displacement,
                 [](std::size_t i) {
                   return std::clamp(device_frame(i)[Channel::displacement], -0.25, 0.25);
                 });
}

TEST(FaultyDriver, InjectsNan) {
  expect_channel(fault(FaultKind::nan, begin_s, length_s), Channel::friction_force,
                 [](std::size_t) { return std::nan(""); });
}

TEST(FaultyDriver, DelaysWithoutReportingTheAge) {
  expect_channel(fault(FaultKind::delay, begin_s, length_s, 0.007), Channel::velocity,
                 [](std::size_t i) { return device_frame(i - 7)[Channel::velocity]; });
}

TEST(FaultyDriver, DelaysAndReportsTheAge) {
  Fault late = on(Channel::normal_load, fault(FaultKind::delay, begin_s, length_s, 0.0075));
  late.reported = true;
  Bench bench({late});
  const auto frames = bench.run().frames(50);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    Frame want = device_frame(i);
    if (is_active(i)) {
      // The latest value 7.5 ms ago is 8 ms old, plus its own age of 250 us.
      want.value[index_of(Channel::normal_load)] = device_frame(i - 8)[Channel::normal_load];
      want.age_us[index_of(Channel::normal_load)] = 8250;
    }
    EXPECT_TRUE(same_bits(frames.at(i), want)) << i;
  }
}

TEST(FaultyDriver, DelayBeginsWithTheFirstFrameAndTheLongestDelayApplies) {
  Bench bench({fault(FaultKind::delay, 0.0, std::nullopt, 0.005),
               on(Channel::velocity, fault(FaultKind::delay, 0.0, std::nullopt, 0.02)),
               fault(FaultKind::delay, 0.0, std::nullopt, 0.001)});
  const auto frames = bench.run().frames(100);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ(frames[i][Channel::displacement],
              device_frame(i < 5 ? 0 : i - 5)[Channel::displacement]);
    EXPECT_EQ(frames[i][Channel::velocity], device_frame(i < 20 ? 0 : i - 20)[Channel::velocity]);
  }
}

TEST(FaultyDriver, NoiseHasItsStandardDeviationAndIsWhite) {
  Bench bench({on(Channel::velocity, fault(FaultKind::noise, 1.0, 4.0, 0.5))});
  const auto frames = bench.run().frames(6000);
  double sum = 0.0;
  double squares = 0.0;
  double lagged = 0.0;
  double before = 0.0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    Frame want = device_frame(i);
    const double noise = frames[i][Channel::velocity] - want[Channel::velocity];
    want.value[index_of(Channel::velocity)] = frames[i][Channel::velocity];
    ASSERT_TRUE(same_bits(frames[i], want)) << "other channels are unchanged";
    if (i < 1000 || i >= 5000) {
      ASSERT_EQ(noise, 0.0);
    } else {
      sum += noise;
      squares += noise * noise;
      lagged += noise * before;
      before = noise;
    }
  }
  const double n = 4000.0;
  EXPECT_NEAR(sum / n, 0.0, 5.0 * 0.5 / std::sqrt(n));
  EXPECT_NEAR(squares / n, 0.25, 5.0 * 0.25 * std::sqrt(2.0 / n));
  EXPECT_NEAR(lagged / n, 0.0, 5.0 * 0.25 / std::sqrt(n));
  EXPECT_EQ(bench.driver.applied().at(0), (Applied{1, 4000, 1'000'000'000, 4'999'000'000}));
}

TEST(FaultyDriver, NoiseIsIndependentBetweenChannels) {
  Bench bench({fault(FaultKind::noise, 0.0, std::nullopt, 0.5)});
  const auto frames = bench.run().frames(1000);
  double product = 0.0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    product += (frames[i].value[0] - device_frame(i).value[0]) *
               (frames[i].value[1] - device_frame(i).value[1]);
  }
  EXPECT_NEAR(product / 1000.0, 0.0, 5.0 * 0.25 / std::sqrt(1000.0));
}

TEST(FaultyDriver, UnmeasuredChannelsStayInvalid) {
  Device device;
  device.channels = 0b000011;
  std::vector<Fault> faults;
  for (const FaultKind kind : {FaultKind::noise, FaultKind::stick, FaultKind::drift,
                               FaultKind::delay, FaultKind::saturate, FaultKind::nan}) {
    faults.push_back(fault(kind, 0.0, std::nullopt, 0.5));
  }
  Bench bench(faults, device);
  for (const Frame& frame : bench.run().frames(20)) {
    EXPECT_EQ(frame.valid, 0b000011);
    for (std::size_t i = 2; i < channel_count; ++i) EXPECT_EQ(frame.value[i], 0.0);
    EXPECT_TRUE(std::isnan(frame.value[0]) && std::isnan(frame.value[1]));
  }
}

TEST(FaultyDriver, FaultsOfAChannelActInSignalOrder) {
  // Listed in reverse, they act in the documented order.
  const auto frames_of = [](std::vector<Fault> faults) { return Bench(faults).run().frames(30); };
  const Fault late = fault(FaultKind::delay, 0.0, std::nullopt, 0.003);
  const Fault drift = fault(FaultKind::drift, 0.0, std::nullopt, 50.0);
  const Fault saturation = fault(FaultKind::saturate, 0.0, std::nullopt, 0.5);
  const Fault stuck = fault(FaultKind::stick, 0.020, 0.005);
  const Fault nan = fault(FaultKind::nan, 0.028, 0.001);
  const auto frames = frames_of({nan, stuck, saturation, drift, late});
  for (std::size_t i = 0; i < 28; ++i) {
    const std::size_t at = i >= 20 && i < 25 ? 20 : i;
    const double delayed = device_frame(at < 3 ? 0 : at - 3)[Channel::velocity];
    const double drifted = delayed + 50.0 * (static_cast<double>(at * 1000000) * 1.0e-9);
    EXPECT_EQ(frames[i][Channel::velocity], std::clamp(drifted, -0.5, 0.5)) << i;
  }
  EXPECT_TRUE(std::isnan(frames[28][Channel::velocity]));
  EXPECT_FALSE(std::isnan(frames[29][Channel::velocity]));
  const Fault noise = fault(FaultKind::noise, 0.0, std::nullopt, 10.0);
  for (const Frame& frame : frames_of({saturation, noise})) {
    EXPECT_LE(std::abs(frame[Channel::velocity]), 0.5);
  }
}

TEST(FaultyDriver, RepetitionRestartsTheFault) {
  Fault stuck = on(Channel::velocity, fault(FaultKind::stick, begin_s, 0.005));
  stuck.every_s = 0.010;
  Fault drift = on(Channel::displacement, fault(FaultKind::drift, begin_s, 0.005, 2.0));
  drift.every_s = 0.010;
  Bench bench({stuck, drift});
  const auto frames = bench.run().frames(40);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    Frame want = device_frame(i);
    if (i >= 10 && i % 10 < 5) {
      const std::size_t first = i - i % 10;
      want.value[index_of(Channel::velocity)] = device_frame(first)[Channel::velocity];
      want.value[index_of(Channel::displacement)] +=
          2.0 * (static_cast<double>((i - first) * 1000000) * 1.0e-9);
    }
    EXPECT_TRUE(same_bits(frames[i], want)) << i;
  }
  EXPECT_EQ(bench.driver.applied().at(0).occurrences, 3U);
  EXPECT_EQ(bench.driver.applied().at(0).hits, 15U);
}

// Faults of frames.

TEST(FaultyDriver, DropsFrames) {
  Bench bench({fault(FaultKind::drop, begin_s, length_s)});
  const auto readings = bench.run().read(50);
  for (std::size_t i = 0; i < readings.size(); ++i) {
    ASSERT_EQ(readings[i].outcome, is_active(i) ? Outcome::no_data : Outcome::ok) << i;
    if (!is_active(i)) {
      EXPECT_TRUE(same_bits(readings[i].frame, device_frame(i))) << i;
    }
  }
  EXPECT_EQ(bench.driver.account().dropped, 20U);
  EXPECT_EQ(bench.device.reads, 50U) << "not replaced: time advances";
}

TEST(FaultyDriver, DuplicatesFrames) {
  Bench bench({fault(FaultKind::duplicate, begin_s, length_s)});
  const auto frames = bench.run().frames(70);
  ASSERT_EQ(frames.size(), 70U);
  std::size_t next = 0;
  for (std::size_t i = 0; i < 50; ++i) {
    EXPECT_TRUE(same_bits(frames.at(next++), device_frame(i)));
    if (is_active(i)) {
      EXPECT_TRUE(same_bits(frames.at(next++), device_frame(i)));
    }
  }
  EXPECT_EQ(bench.driver.account().duplicated, 20U);
}

TEST(FaultyDriver, ReordersFramesWithoutLoss) {
  for (const bool paced : {false, true}) {
    Device device;
    device.paced = paced;
    Bench bench({fault(FaultKind::reorder, begin_s, length_s)}, device);
    const auto readings = bench.run().read(60);
    std::vector<std::size_t> order;
    for (const Reading& each : readings) {
      if (each.outcome != Outcome::ok) continue;
      EXPECT_TRUE(is_device_frame(each.frame));
      order.push_back(each.frame.sequence - first_sequence);
    }
    ASSERT_GE(order.size(), 50U);
    for (std::size_t i = 0; i < 50; ++i) {
      const std::size_t swapped = i % 2 == 0 ? i + 1 : i - 1;
      EXPECT_EQ(order[i], is_active(i) ? swapped : i) << "paced " << paced;
    }
    const auto waits = std::count_if(readings.begin(), readings.end(), [](const Reading& each) {
      return each.outcome == Outcome::no_data;
    });
    // A paced device is not read twice in one cycle.
    EXPECT_EQ(waits, paced ? 10 : 0);
    EXPECT_EQ(bench.driver.applied().at(0).hits, 10U);
  }
}

TEST(FaultyDriver, OvertakenFrameIsDeliveredAtTheEndOfData) {
  Device device;
  device.end = 5;
  Bench bench({fault(FaultKind::reorder, 0.004, std::nullopt)}, device);
  const auto readings = bench.run().read(7);
  for (std::size_t i = 0; i < 5; ++i) {
    ASSERT_EQ(readings[i].outcome, Outcome::ok);
    EXPECT_TRUE(same_bits(readings[i].frame, device_frame(i)));
  }
  EXPECT_EQ(readings[5].outcome, Outcome::end_of_data);
  EXPECT_EQ(readings[6].outcome, Outcome::end_of_data);
  EXPECT_EQ(bench.driver.applied().at(0).hits, 0U);
}

TEST(FaultyDriver, OvertakenFrameWaitsForTheNext) {
  Device device;
  device.instead = {{3, Outcome::no_data}, {4, Outcome::temporary}};
  Bench bench({fault(FaultKind::reorder, 0.002, 0.001)}, device);
  const auto readings = bench.run().read(7);
  const std::vector<Outcome> outcomes = {Outcome::ok,        Outcome::ok, Outcome::no_data,
                                         Outcome::temporary, Outcome::ok, Outcome::ok,
                                         Outcome::ok};
  for (std::size_t i = 0; i < outcomes.size(); ++i) EXPECT_EQ(readings[i].outcome, outcomes[i]);
  EXPECT_TRUE(same_bits(readings[4].frame, device_frame(3)));
  EXPECT_TRUE(same_bits(readings[5].frame, device_frame(2)));
  EXPECT_TRUE(same_bits(readings[6].frame, device_frame(4)));
}

TEST(FaultyDriver, StalledDeviceIsNotReadForAnOvertakingFrame) {
  Bench bench({fault(FaultKind::reorder, 0.009, 0.001),
               fault(FaultKind::stall, begin_s, std::nullopt, length_s)});
  const auto readings = bench.run().read(32);
  for (std::size_t i = 9; i < 30; ++i) EXPECT_EQ(readings[i].outcome, Outcome::no_data) << i;
  EXPECT_TRUE(same_bits(readings[30].frame, device_frame(10)));
  EXPECT_TRUE(same_bits(readings[31].frame, device_frame(9)));
}

TEST(FaultyDriver, ClockJumpAffectsTimeOnly) {
  for (const double jump_s : {5.0, -2.5}) {
    Bench bench({fault(FaultKind::clock_jump, begin_s, length_s, jump_s)});
    const auto frames = bench.run().frames(50);
    for (std::size_t i = 0; i < frames.size(); ++i) {
      Frame want = device_frame(i);
      if (is_active(i)) want.time_ns += std::llround(jump_s * 1.0e9);
      EXPECT_TRUE(same_bits(frames[i], want)) << i;
    }
  }
}

TEST(FaultyDriver, ProbabilitiesApplyToFrames) {
  for (const FaultKind kind : {FaultKind::drop, FaultKind::duplicate, FaultKind::nan}) {
    Bench bench({with_probability(0.1, fault(kind, 1.0, 8.0))});
    const auto frames = bench.run().frames(10000);
    std::map<std::uint64_t, int> times;
    std::uint64_t not_a_number = 0;
    for (const Frame& frame : frames) {
      ++times[frame.sequence - first_sequence];
      if (std::isnan(frame.value[0])) ++not_a_number;
    }
    std::uint64_t other_than_once = 0;
    for (std::uint64_t i = 0; i < bench.device.frames - 1; ++i) {
      if (times[i] != 1) {
        ++other_than_once;
        EXPECT_TRUE(i >= 1000 && i < 9000);
      }
    }
    const std::uint64_t hits = bench.driver.applied().at(0).hits;
    EXPECT_EQ(kind == FaultKind::nan ? not_a_number : other_than_once, hits);
    EXPECT_NEAR(static_cast<double>(hits), 800.0, 5.0 * std::sqrt(8000 * 0.1 * 0.9));
  }
}

// Faults of the connection.

TEST(FaultyDriver, StalledDeviceReturnsNothingAndContinues) {
  Bench bench({fault(FaultKind::stall, begin_s, std::nullopt, length_s)});
  const auto readings = bench.run().read(70);
  std::size_t next = 0;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    ASSERT_EQ(readings[i].outcome, is_active(i) ? Outcome::no_data : Outcome::ok) << i;
    if (!is_active(i)) {
      EXPECT_TRUE(same_bits(readings[i].frame, device_frame(next++))) << i;
    }
  }
  EXPECT_EQ(bench.device.reads, 50U);
  EXPECT_EQ(bench.clock->slept, 0) << "no wait for an unpaced device";
}

TEST(FaultyDriver, StalledPacedDeviceDoesNotMakeTheReaderBusyWait) {
  Device device;
  device.paced = true;
  Bench bench({fault(FaultKind::stall, begin_s, std::nullopt, length_s)}, device, 1, period_s, 2.0);
  bench.run().read(70);
  EXPECT_EQ(bench.clock->slept, 20 * period_ns / 2) << "at twice the recorded speed";
}

TEST(FaultyDriver, BlockingReadLastsForItsDuration) {
  Fault hang = fault(FaultKind::stall, begin_s, std::nullopt, 0.050);
  hang.stall_blocking = true;
  Bench bench({hang});
  const auto readings = bench.run().read(40);
  EXPECT_EQ(bench.clock->slept, 50'000'000);
  std::size_t next = 0;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    ASSERT_EQ(readings[i].outcome, i == 10 ? Outcome::no_data : Outcome::ok) << i;
    if (i != 10) {
      EXPECT_TRUE(same_bits(readings[i].frame, device_frame(next++))) << i;
    }
  }
  // Script time has advanced.
  EXPECT_EQ(bench.driver.script_time_ns(), (38 + 50) * period_ns);
  Bench fast({hang}, {}, 1, period_s, 4.0);
  fast.run().read(40);
  EXPECT_EQ(fast.clock->slept, 12'500'000) << "a replay at four times the recorded speed";
}

TEST(FaultyDriver, ReadErrorsAreTemporary) {
  Bench bench({fault(FaultKind::read_error, begin_s, length_s)});
  const auto readings = bench.run().read(70);
  std::size_t next = 0;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    ASSERT_EQ(readings[i].outcome, is_active(i) ? Outcome::temporary : Outcome::ok) << i;
    if (is_active(i)) {
      EXPECT_EQ(readings[i].message, "fault 1 of test.toml: reads fail: at 0.01 s for 0.02 s");
    } else {
      EXPECT_TRUE(same_bits(readings[i].frame, device_frame(next++))) << i;
    }
  }
}

TEST(FaultyDriver, WriteErrorsStillForwardOff) {
  Bench bench({fault(FaultKind::write_error, begin_s, length_s)});
  bench.run();
  for (std::size_t i = 0; i < 50; ++i) {
    const Reading reading = bench.read();
    EXPECT_TRUE(same_bits(reading.frame, device_frame(i)));
    const auto before = bench.device.writes.size();
    const bool amplifier_on = i % 3 != 0;
    const Result result = bench.driver.write({0.001, amplifier_on});
    EXPECT_EQ(result.outcome, is_active(i) ? Outcome::temporary : Outcome::ok);
    EXPECT_EQ(bench.device.writes.size() - before, !is_active(i) || !amplifier_on ? 1U : 0U);
  }
  EXPECT_EQ(bench.driver.applied().at(0).hits, 20U);
}

TEST(FaultyDriver, InputLinesAreAssertedAndReleased) {
  for (const bool of_device : {false, true}) {
    Device device;
    device.signals.amplifier_fault = of_device;
    Bench bench({fault(FaultKind::emergency_stop, begin_s, length_s),
                 fault(FaultKind::amplifier_fault, 0.020, 0.020)},
                device);
    const auto readings = bench.run().read(50);
    for (std::size_t i = 0; i < readings.size(); ++i) {
      EXPECT_EQ(readings[i].signals.emergency_stop, is_active(i));
      EXPECT_EQ(readings[i].signals.amplifier_fault, of_device || (i >= 20 && i < 40));
      EXPECT_TRUE(same_bits(readings[i].frame, device_frame(i)));
    }
  }
}

TEST(FaultyDriver, OutputIsReportedAsDiffering) {
  Bench bench({fault(FaultKind::output_differs, begin_s, length_s)});
  const auto readings = bench.run().read(50);
  for (std::size_t i = 0; i < readings.size(); ++i) {
    EXPECT_EQ(readings[i].signals.differing_output.name != nullptr, is_active(i));
  }
}

TEST(FaultyDriver, UnpluggedDeviceIsLostUntilReopened) {
  Bench bench({fault(FaultKind::unplug, begin_s, length_s)});
  bench.run().read(10);
  bench.driver.write({0.005, true});
  for (int i = 10; i < 29; ++i) {
    const Reading reading = bench.read();
    EXPECT_EQ(reading.outcome, Outcome::lost);
    EXPECT_EQ(reading.message,
              "fault 1 of test.toml: the device is unplugged: at 0.01 s for 0.02 s");
    EXPECT_EQ(bench.driver.write({0.005, true}).outcome, Outcome::lost);
    EXPECT_EQ(bench.driver.start().outcome, Outcome::lost);
  }
  // "Off" was sent immediately, and nothing since.
  ASSERT_EQ(bench.device.writes.size(), 2U);
  EXPECT_FALSE(bench.device.writes.back().amplifier_on);
  EXPECT_EQ(bench.device.writes.back().drive, 0.0);
  EXPECT_EQ(bench.device.reads, 10U);

  // It is attached again, but its handle is invalid.
  const Reading reading = bench.read();
  EXPECT_EQ(reading.outcome, Outcome::lost);
  EXPECT_THAT(reading.message, testing::HasSubstr("attached again"));
  EXPECT_EQ(bench.driver.start().outcome, Outcome::lost);
  EXPECT_EQ(bench.device.opens, 1);
  bench.driver.stop();
  bench.driver.close();
  EXPECT_EQ(bench.read().outcome, Outcome::lost);
  EXPECT_TRUE(bench.driver.open());
  EXPECT_TRUE(bench.driver.start());
  EXPECT_EQ(bench.device.opens, 2);
  EXPECT_EQ(bench.device.starts, 2);
  const auto frames = bench.frames(20);
  ASSERT_EQ(frames.size(), 20U);
  for (std::size_t i = 0; i < 20; ++i) EXPECT_TRUE(same_bits(frames[i], device_frame(10 + i)));
  EXPECT_TRUE(bench.driver.write({0.005, true}));
  EXPECT_EQ(bench.driver.applied().at(0).occurrences, 1U);
}

TEST(FaultyDriver, UnpluggedDeviceIsNotReadBeforeItIsStarted) {
  Bench bench({fault(FaultKind::unplug, begin_s, length_s)});
  bench.run().read(30);
  ASSERT_TRUE(bench.driver.open());
  EXPECT_EQ(bench.read().outcome, Outcome::fatal);
  EXPECT_EQ(bench.driver.write({0.001, true}).outcome, Outcome::fatal);
  EXPECT_TRUE(bench.driver.write({0.0, false}));
  ASSERT_TRUE(bench.driver.start());
  EXPECT_EQ(bench.read().outcome, Outcome::ok);
}

TEST(FaultyDriver, TimeBetweenReopenAttemptsCountsTowardsTheUnplug) {
  Bench bench({fault(FaultKind::unplug, 1.0, 2.0)});
  bench.run().read(1001);
  int attempts = 0;
  do {
    bench.clock->now += 250'000'000;
    ASSERT_LT(++attempts, 20);
  } while (!bench.driver.open());
  // The read that detected the unplug counts as the first period of the two seconds.
  EXPECT_EQ(attempts, 8);
  ASSERT_TRUE(bench.driver.start());
  EXPECT_TRUE(same_bits(bench.read().frame, device_frame(1000)));
}

TEST(FaultyDriver, ReadsBetweenAttemptsAreNotCountedTwice) {
  Bench bench({fault(FaultKind::unplug, 1.0, 2.0)});
  bench.run().read(1001);
  int reads = 0;
  while (true) {
    bench.clock->now += 100'000'000;
    bench.read(100);
    reads += 100;
    if (bench.driver.open()) break;
    ASSERT_LT(reads, 3000);
  }
  EXPECT_EQ(reads, 2000);
}

TEST(FaultyDriver, DeviceAbsentAtTheStartDoesNotOpen) {
  Bench bench({fault(FaultKind::unplug, 0.0, 0.003)});
  EXPECT_EQ(bench.driver.open().outcome, Outcome::lost);
  EXPECT_EQ(bench.device.opens, 0);
  EXPECT_EQ(bench.driver.start().outcome, Outcome::lost);
  int attempts = 1;
  while (!bench.driver.open()) ASSERT_LT(++attempts, 10);
  EXPECT_EQ(attempts, 3);
  ASSERT_TRUE(bench.driver.start());
  EXPECT_TRUE(same_bits(bench.read().frame, device_frame(0)));
}

TEST(FaultyDriver, UnplugTakesPrecedenceOverStallAndStallOverReadErrors) {
  Bench bench({fault(FaultKind::read_error, 0.010, 0.030),
               fault(FaultKind::stall, 0.015, std::nullopt, 0.015),
               fault(FaultKind::unplug, 0.020, 0.005)});
  const auto readings = bench.run().read(25);
  for (std::size_t i = 0; i < readings.size(); ++i) {
    EXPECT_EQ(readings[i].outcome, i < 10   ? Outcome::ok
                                   : i < 15 ? Outcome::temporary
                                   : i < 20 ? Outcome::no_data
                                            : Outcome::lost);
  }
}

TEST(FaultyDriver, PendingFramesAreDiscardedOnUnplug) {
  Bench bench({fault(FaultKind::duplicate, 0.0, 0.009), fault(FaultKind::unplug, 0.0095, 0.002)});
  bench.run();
  while (bench.read().outcome == Outcome::ok) {
  }
  EXPECT_EQ(bench.driver.account().discarded, 1U);
  EXPECT_EQ(bench.driver.account().waiting, 0U);
  EXPECT_TRUE(bench.driver.account().balances());
}

TEST(FaultyDriver, FaultOnAMissingChannelIsRejected) {
  Device device;
  device.channels = 0b000011;
  Bench bench({on(Channel::drive_force, fault(FaultKind::nan, 0.0, 1.0))}, device);
  const Result result = bench.driver.open();
  EXPECT_EQ(result.outcome, Outcome::needs_attention);
  EXPECT_THAT(result.message, testing::HasSubstr("fault 1 of test.toml: not a number on "
                                                 "drive_force: at 0 s for 1 s"));
  EXPECT_THAT(result.message, testing::HasSubstr("does not provide that channel"));
  EXPECT_EQ(bench.device.closes, 1);
}

TEST(FaultyDriver, DescribesItselfAsFaulty) {
  Bench bench({fault(FaultKind::drop, 0.0, 1.0)});
  bench.run();
  EXPECT_EQ(bench.driver.description().name, "device with injected faults");
}

TEST(FaultyDriver, FractionalPeriodsDoNotShiftReads) {
  // Time stamps of a device of 3 kHz, but a script period rounded to the nanosecond.
  class Third final : public Driver {
   public:
    Result open() override { return {}; }
    Result start() override { return {}; }
    Result read(Frame& frame) override {
      frame = {};
      frame.sequence = next_++;
      frame.time_ns = std::llround(static_cast<double>(frame.sequence) * 1.0e9 / 3000.0);
      return {};
    }
    Result write(const Actuation&) override { return {}; }
    void stop() noexcept override {}
    void close() noexcept override {}
    const Description& description() const override { return description_; }

   private:
    std::uint64_t next_ = 0;
    Description description_;
  };
  FaultyDriver driver(
      std::make_unique<Third>(),
      {.file = "f", .text = "", .seed = 1, .faults = {fault(FaultKind::stall, 2.0, {}, 1.0)}},
      Pace{1.0 / 3000.0, 1.0});
  ASSERT_TRUE(driver.open());
  ASSERT_TRUE(driver.start());
  for (int i = 0; i < 10000; ++i) {
    Frame frame;
    ASSERT_EQ(driver.read(frame).outcome, i >= 6000 && i < 9000 ? Outcome::no_data : Outcome::ok)
        << i;
  }
}

TEST(FaultyDriver, TimeElapsedInAStallIsNotCountedTwice) {
  // The frames during the stall are lost: the next one is a second later.
  Device device;
  Bench bench(
      {fault(FaultKind::stall, 0.010, std::nullopt, 1.0), fault(FaultKind::nan, 1.020, 0.001)},
      device);
  bench.run().read(1010);
  bench.device.frames += 1000;
  const auto frames = bench.frames(20);
  ASSERT_EQ(frames.size(), 20U);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ(std::isnan(frames[i].value[0]), frames[i].time_ns == origin_ns + 1'020'000'000);
  }
}

// Properties for all scripts.

Fault some_fault() {
  Fault out;
  out.kind =
      static_cast<FaultKind>(*rc::gen::inRange(0, static_cast<int>(config::fault_kind_count)));
  out.from_s = 0.0005 * *rc::gen::inRange(0, 200);
  out.to_s = out.from_s + 0.0005 * *rc::gen::inRange(0, 40);
  out.duration_s = 0.0005 * *rc::gen::inRange(1, 60);
  if (out.kind == FaultKind::clock_jump) {
    out.amount = 0.001 * *rc::gen::inRange(-50, 50);
  } else {
    out.amount = 0.001 * *rc::gen::inRange(1, 50);
  }
  if (out.kind == FaultKind::stall) {
    out.duration_s = out.amount;
    out.stall_blocking = *rc::gen::arbitrary<bool>();
  }
  if (*rc::gen::arbitrary<bool>()) {
    out.channel = *rc::gen::element(Channel::displacement, Channel::velocity, Channel::normal_load);
  }
  out.reported = *rc::gen::arbitrary<bool>();
  switch (out.kind) {
    case FaultKind::noise:
    case FaultKind::nan:
    case FaultKind::drop:
    case FaultKind::duplicate:
    case FaultKind::reorder:
    case FaultKind::read_error:
    case FaultKind::write_error:
      out.probability = 0.1 * *rc::gen::inRange(1, 11);
      break;
    default:
      break;
  }
  return out;
}

std::vector<Fault> some_faults() {
  std::vector<Fault> out;
  const int count = *rc::gen::inRange(1, 8);
  for (int i = 0; i < count; ++i) out.push_back(some_fault());
  return out;
}

/// Reads, and reopens after an unplug.
std::vector<Reading> run_through(Bench& bench, int reads) {
  std::vector<Reading> out;
  bench.driver.open();
  bench.driver.start();
  for (int i = 0; i < reads; ++i) {
    out.push_back(bench.read());
    bench.driver.write({0.001, i % 5 != 0});
    if (out.back().outcome == Outcome::lost || out.back().outcome == Outcome::fatal) {
      if (bench.driver.open()) bench.driver.start();
    }
  }
  return out;
}

/// Number of reads after which all faults of some_faults are over and no frame is pending.
constexpr int reads_until_all_faults_end = 1500;

RC_GTEST_PROP(FaultyDriver, FaultsAreDeterministicForASeed, ()) {
  const auto faults = some_faults();
  Device device;
  device.paced = *rc::gen::arbitrary<bool>();
  Bench one(faults, device, 5);
  Bench two(faults, device, 5);
  const auto first = run_through(one, 300);
  const auto second = run_through(two, 300);
  for (std::size_t i = 0; i < first.size(); ++i) {
    // The payload of the injected NaN is constant.
    RC_ASSERT(same(first[i], second[i]));
  }
  RC_ASSERT(one.driver.applied() == two.driver.applied());
  RC_ASSERT(one.driver.account() == two.driver.account());
}

RC_GTEST_PROP(FaultyDriver, FramesAreUnchangedAfterTheEndOfAllFaults, ()) {
  const auto faults = some_faults();
  Device device;
  device.paced = *rc::gen::arbitrary<bool>();
  Bench bench(faults, device, *rc::gen::inRange<std::uint64_t>(0, 1000));
  run_through(bench, reads_until_all_faults_end);
  std::optional<std::uint64_t> before;
  for (const Reading& each : bench.read(20)) {
    RC_ASSERT(each.outcome == Outcome::ok);
    RC_ASSERT(is_device_frame(each.frame));
    RC_ASSERT(!before || each.frame.sequence == *before + 1);
    before = each.frame.sequence;
    RC_ASSERT(!each.signals.emergency_stop && !each.signals.amplifier_fault);
  }
}

RC_GTEST_PROP(FaultyDriver, FramesAndEffectsAreAccountedFor, ()) {
  const auto faults = some_faults();
  Bench bench(faults, {}, *rc::gen::inRange<std::uint64_t>(0, 1000));
  const auto readings = run_through(bench, reads_until_all_faults_end);
  const FrameAccount account = bench.driver.account();
  std::uint64_t given = 0;
  std::map<std::uint64_t, int> times;
  for (const Reading& each : readings) {
    if (each.outcome != Outcome::ok) continue;
    ++given;
    ++times[each.frame.sequence];
  }
  RC_ASSERT(account.balances());
  RC_ASSERT(account.given == given);
  RC_ASSERT(account.taken == bench.device.frames);
  std::uint64_t twice = 0;
  for (const auto& [sequence, count] : times) {
    RC_ASSERT(count <= 2);
    if (count == 2) ++twice;
  }
  RC_ASSERT(times.size() + account.dropped + account.discarded + account.waiting >= account.taken);
  RC_ASSERT(twice <= account.duplicated);
  std::uint64_t drops = 0;
  std::uint64_t duplicates = 0;
  for (std::size_t i = 0; i < faults.size(); ++i) {
    const Applied& applied = bench.driver.applied()[i];
    if (faults[i].kind == FaultKind::drop) drops += applied.hits;
    if (faults[i].kind == FaultKind::duplicate) duplicates += applied.hits;
    RC_ASSERT(applied.occurrences <= 1U);
    RC_ASSERT(applied.hits == 0U || applied.occurrences == 1U);
  }
  RC_ASSERT(drops == account.dropped);
  RC_ASSERT(duplicates == account.duplicated);
}

RC_GTEST_PROP(FaultyDriver, TimeIncreasesUnlessTheScriptChangesIt, ()) {
  auto faults = some_faults();
  std::erase_if(faults, [](const Fault& each) {
    return each.kind == FaultKind::clock_jump || each.kind == FaultKind::reorder;
  });
  Bench bench(faults, {}, *rc::gen::inRange<std::uint64_t>(0, 1000));
  std::int64_t before = origin_ns;
  std::int64_t script_before = -period_ns;
  bench.driver.open();
  bench.driver.start();
  for (int i = 0; i < 300; ++i) {
    const Reading each = bench.read();
    RC_ASSERT(bench.driver.script_time_ns() >= script_before);
    script_before = bench.driver.script_time_ns();
    if (each.outcome == Outcome::lost && bench.driver.open()) bench.driver.start();
    if (each.outcome != Outcome::ok) continue;
    RC_ASSERT(each.frame.time_ns >= before);
    before = each.frame.time_ns;
  }
}

TEST(FaultyDriver, TheLifecycleMayBeCalledInAnyOrder) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    std::mt19937 random(seed);
    Bench bench({fault(FaultKind::unplug, 0.002, 0.004), fault(FaultKind::reorder, 0.0, 1.0),
                 fault(FaultKind::duplicate, 0.0, 1.0), fault(FaultKind::delay, 0.0, 1.0, 0.01)});
    for (int i = 0; i < 60; ++i) {
      switch (random() % 6) {
        case 0:
          bench.driver.open();
          break;
        case 1:
          bench.driver.start();
          break;
        case 2:
        case 3:
          bench.read();
          break;
        case 4:
          bench.driver.stop();
          break;
        default:
          bench.driver.close();
      }
    }
    EXPECT_EQ(bench.driver.account().taken, bench.device.frames);
  }
}

// As created for the daemon.

TEST(FaultLibrary, EachScriptHasAnEffectAndTheBalanceHolds) {
  const config::Rig rig = config::load_rig(STICKSLIP_SOURCE_DIR "/config/simulated.toml");
  for (const auto& entry :
       std::filesystem::directory_iterator(STICKSLIP_SOURCE_DIR "/config/faults")) {
    SCOPED_TRACE(entry.path());
    const config::FaultScript script = config::load_fault_script(entry.path());
    Device device;
    device.channels = 0b011111;  // those of the simulated rig
    const auto clock = std::make_shared<TestClock>();
    FaultyDriver driver(std::make_unique<DeviceDriver>(device), script,
                        Pace{1.0 / rig.loop.rate_hz, 1.0}, clock);
    ASSERT_TRUE(driver.open());
    ASSERT_TRUE(driver.start());
    for (int i = 0; i < 30000; ++i) {
      Frame frame;
      const Result result = driver.read(frame);
      driver.write({0.001, true});
      if (result.outcome == Outcome::lost && driver.open()) {
        ASSERT_TRUE(driver.start());
      }
    }
    for (const Applied& applied : driver.applied()) EXPECT_GT(applied.hits, 0U);
    EXPECT_TRUE(driver.account().balances());
    Frame last;
    EXPECT_TRUE(driver.read(last)) << "after the script";
  }
}

TEST(MakeDriver, AppliesTheFaultScriptOfTheRig) {
  config::Rig rig = config::load_rig(STICKSLIP_SOURCE_DIR "/config/simulated.toml");
  rig.faults = config::load_fault_script(STICKSLIP_SOURCE_DIR "/config/faults/everything.toml");
  const auto simulated = make_driver(rig);
  ASSERT_TRUE(simulated->open());
  EXPECT_EQ(simulated->description().name, "simulated rig with injected faults");
  EXPECT_TRUE(simulated->description().stepped_time);

  // For a recording of 100 Hz, at any rate of the loop, a stall of 50 ms costs five reads.
  rig.driver = config::DriverKind::replay;
  rig.replay.speed = 0.0;
  rig.faults->faults = {fault(FaultKind::stall, 0.02, {}, 0.05)};
  std::vector<Frame> frames(20);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    frames[i].time_ns = static_cast<std::int64_t>(i) * 10'000'000 + (i > 10 ? 3'000'000'000 : 0);
  }
  const auto replay = make_driver(rig, frames);
  ASSERT_TRUE(replay->open());
  ASSERT_TRUE(replay->start());
  std::string outcomes;
  for (int i = 0; i < 10; ++i) {
    Frame frame;
    outcomes += replay->read(frame) ? '+' : '-';
  }
  EXPECT_EQ(outcomes, "++-----+++");
}

}  // namespace
}  // namespace stickslip::drivers
