// SPDX-License-Identifier: Apache-2.0
// The real driver of the LabJack T7 with the emulated board on the loopback interface. Waits are
// for events, with a limit that a busy machine does not reach.
#include "drivers/labjack_t7/labjack_t7_driver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <memory>
#include <numbers>
#include <thread>
#include <vector>

#include "drivers/bench/probe_bench.h"
#include "drivers/clock/stream_clock.h"
#include "drivers/factory/make_bench.h"
#include "tests/emulated/labjack_t7/emulated_labjack_t7.h"
#include "tests/unit/heap_count/heap_count.h"

namespace stickslip::emulated {
namespace {

using drivers::LabjackT7Driver;
using drivers::Outcome;
using drivers::Result;
using std::chrono::seconds;
using std::chrono::steady_clock;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr auto long_enough = seconds(20);

/// Two inputs in quadrature, so that consecutive scans differ.
class SineWires final : public Wires {
 public:
  static double volts(Channel channel, std::int64_t time_ns) {
    const double turns = 40.0 * static_cast<double>(time_ns) * 1e-9;
    const double quarter = channel == Channel::velocity ? 0.25 : 0.0;
    return 5.0 * std::sin(2.0 * std::numbers::pi * (turns + quarter));
  }
  double truth(Channel channel, std::int64_t time_ns) override { return volts(channel, time_ns); }
  void drive(double volts, std::int64_t) override { driven = volts; }
  void enable(bool on, std::int64_t) override { enabled = on; }
  bool amplifier_fault() const override { return fault; }
  bool emergency_stop() const override { return pressed; }

  std::atomic<double> driven{0.0};
  std::atomic<bool> enabled{false};
  std::atomic<bool> fault{false};
  std::atomic<bool> pressed{false};
};

config::LabjackT7 settings() {
  config::LabjackT7 out;
  out.host = "127.0.0.1";
  out.enable_line = 2;
  out.amplifier_fault_line = 3;
  out.emergency_stop_line = 4;
  out.watchdog_s = 1;
  return out;
}

config::BenchInputs inputs() {
  config::BenchInputs out;
  out[index_of(Channel::displacement)] = {.device = "labjack_t7", .input = "AIN0"};
  out[index_of(Channel::velocity)] = {.device = "labjack_t7", .input = "AIN3"};
  return out;
}

struct Bench {
  explicit Bench(double rate_hz = 1000.0, config::LabjackT7 chosen = settings(),
                 const config::BenchInputs& wired = inputs(), const T7Options& options = {})
      : board(
            wires, [this] { return clock.now_ns(); }, options),
        driver(at_board(chosen), wired, rate_hz, clock) {
    board.wire(0, {Channel::displacement});
    board.wire(3, {Channel::velocity});
  }

  config::LabjackT7 at_board(config::LabjackT7 chosen) const {
    chosen.port = board.port();
    chosen.stream_port = board.stream_port();
    return chosen;
  }

  bool begin() {
    last = driver.open();
    if (last) last = driver.start();
    return static_cast<bool>(last);
  }

  /// That many frames, or fewer if the stream ends.
  std::vector<Frame> frames(std::size_t count) {
    std::vector<Frame> out;
    const auto end = steady_clock::now() + long_enough;
    while (out.size() < count && steady_clock::now() < end) {
      Frame frame;
      last = driver.read(frame);
      if (last) {
        out.push_back(frame);
      } else if (last.outcome != Outcome::no_data) {
        break;
      }
    }
    return out;
  }

  /// Reads and writes until the condition holds.
  template <class Condition>
  bool until(const drivers::Actuation& wanted, Condition condition) {
    const auto end = steady_clock::now() + long_enough;
    while (!condition()) {
      if (steady_clock::now() > end) return false;
      Frame frame;
      static_cast<void>(driver.read(frame));
      last = driver.write(wanted);
    }
    return true;
  }

  /// The result that ends the stream.
  Result stream_end() {
    frames(1U << 20U);
    return last;
  }

  std::uint64_t count(const std::string& name) const {
    const drivers::Counts counts = driver.counts();
    for (const drivers::Count& one : counts.all()) {
      if (one.name == name) return one.value;
    }
    return 0xDEAD;
  }

  drivers::MonotonicHostClock clock;
  SineWires wires;
  EmulatedLabjackT7 board;
  LabjackT7Driver driver;
  Result last;
};

/// Every frame holds the voltages at its time, within half a step of the converter.
void expect_true(const std::vector<Frame>& frames) {
  constexpr double half_step_v = 0.5 * 3.18e-4;
  std::size_t wrong = 0;
  for (const Frame& frame : frames) {
    const auto near = [&frame](Channel channel) {
      return std::abs(frame.value[index_of(channel)] - SineWires::volts(channel, frame.time_ns)) <=
             half_step_v;
    };
    if (frame.valid != 0b11 || !near(Channel::displacement) || !near(Channel::velocity)) ++wrong;
  }
  EXPECT_EQ(wrong, 0U) << "of " << frames.size();
}

std::string where(const Bench& bench) { return "127.0.0.1:" + std::to_string(bench.board.port()); }

TEST(LabjackT7, FramesAreTheScansByNumberTimeAndCalibratedVoltage) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    Bench bench(2000.0, settings(), inputs(), {.seed = seed});
    ASSERT_TRUE(bench.begin()) << bench.last.message;
    EXPECT_EQ(bench.driver.description().name, "LabJack T7 #470012345 at " + where(bench));
    EXPECT_EQ(bench.driver.description().channels, 0b11);
    EXPECT_TRUE(bench.driver.description().own_clock);
    const std::vector<Frame> frames = bench.frames(300);
    ASSERT_EQ(frames.size(), 300U) << bench.last.message;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      ASSERT_EQ(frames[i].sequence, i);
      ASSERT_EQ(frames[i].time_ns, static_cast<std::int64_t>(i) * 500'000);
    }
    expect_true(frames);
    bench.driver.close();
    EXPECT_FALSE(bench.board.streaming());
    EXPECT_EQ(bench.driver.left_on(), nullptr);
  }
}

TEST(LabjackT7, RangesAndPairsAreConfigured) {
  config::BenchInputs wired;
  wired[index_of(Channel::displacement)] = {
      .device = "labjack_t7", .input = "AIN2", .range_v = 0.1, .differential = true};
  Bench bench(1000.0, settings(), wired);
  bench.board.wire(2, {Channel::displacement, 0.02, 0.05});
  bench.board.wire(3, {Channel::displacement, 0.01, 0.05});
  ASSERT_TRUE(bench.begin()) << bench.last.message;
  const std::vector<Frame> frames = bench.frames(50);
  ASSERT_EQ(frames.size(), 50U);
  for (const Frame& frame : frames) {
    const double difference_v = 0.01 * SineWires::volts(Channel::displacement, frame.time_ns);
    EXPECT_NEAR(frame.value[0], difference_v, 0.5 * 3.18e-6);
  }
}

TEST(LabjackT7, OutputsAreReadBackWithTheScans) {
  config::LabjackT7 chosen = settings();
  chosen.drive_readback = config::BenchInput{.device = "labjack_t7", .input = "AIN12"};
  Bench bench(1000.0, chosen);
  bench.board.wire(12, {Channel::displacement, 0.0, 2.5});
  ASSERT_TRUE(bench.begin()) << bench.last.message;
  ASSERT_EQ(bench.frames(1).size(), 1U);
  ASSERT_TRUE(bench.driver.output_readings().drive_v);
  EXPECT_NEAR(*bench.driver.output_readings().drive_v, 2.5, 2e-4);
  EXPECT_FALSE(bench.driver.output_readings().enable_v);
}

TEST(LabjackT7, StampsFollowTheClockOfTheScans) {
  Bench bench;
  ASSERT_TRUE(bench.begin()) << bench.last.message;
  drivers::StreamClock clock;
  std::int64_t last_ns = 0;
  std::uint64_t stamped = 0;
  for (int i = 0; i < 400; ++i) {
    const std::vector<Frame> one = bench.frames(1);
    ASSERT_EQ(one.size(), 1U) << bench.last.message;
    clock.take(one.front(), bench.clock.now_ns());
    for (Frame placed; clock.next(placed); ++stamped) {
      ASSERT_EQ(placed.sequence, stamped);
      ASSERT_GT(placed.time_ns, last_ns);
      last_ns = placed.time_ns;
    }
  }
  EXPECT_GT(stamped, 200U);
  EXPECT_LE(last_ns, bench.clock.now_ns());
}

TEST(LabjackT7, SkippedScansAreCountedExactly) {
  Bench bench(5000.0);
  ASSERT_TRUE(bench.begin()) << bench.last.message;
  std::vector<Frame> frames = bench.frames(100);
  bench.board.overflow_by(200);
  const std::vector<Frame> more = bench.frames(1500);
  ASSERT_EQ(more.size(), 1500U) << bench.last.message;
  frames.insert(frames.end(), more.begin(), more.end());
  expect_true(frames);
  std::uint64_t missing = 0;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    missing += frames[i].sequence - frames[i - 1].sequence - 1;
  }
  EXPECT_GE(missing, 200U);
  EXPECT_EQ(missing, bench.board.scans_skipped());
  EXPECT_EQ(bench.count("overflows"), bench.board.overflows());
  EXPECT_EQ(bench.count("scans_thrown_away"), missing);
  EXPECT_EQ(bench.count("scans_lost"), missing);
  EXPECT_EQ(bench.count("packets_lost"), 0U);
  EXPECT_GT(bench.count("fullest_backlog_bytes"), 500U);
}

TEST(LabjackT7, AMissingPacketCostsItsScans) {
  Bench bench;
  ASSERT_TRUE(bench.begin()) << bench.last.message;
  bench.frames(20);
  bench.board.fault_next_packet(T7StreamFault::missing);
  const std::vector<Frame> frames = bench.frames(200);
  ASSERT_EQ(frames.size(), 200U) << bench.last.message;
  expect_true(frames);
  EXPECT_EQ(bench.count("packets_lost"), 1U);
  EXPECT_EQ(bench.count("scans_lost"), 5U);  // 5 ms
}

struct EndOfStream {
  T7StreamFault fault;
  Outcome outcome;
  const char* text;
};
class FaultyStream : public testing::TestWithParam<EndOfStream> {};

TEST_P(FaultyStream, EndsWithAMessageAndTheNextOneRuns) {
  Bench bench;
  ASSERT_TRUE(bench.begin()) << bench.last.message;
  bench.frames(20);
  bench.board.fault_next_packet(GetParam().fault);
  const Result end = bench.stream_end();
  EXPECT_EQ(end.outcome, GetParam().outcome);
  EXPECT_THAT(end.message, HasSubstr(where(bench)));
  EXPECT_THAT(end.message, HasSubstr(GetParam().text));
  bench.driver.close();
  EXPECT_EQ(bench.driver.left_on(), nullptr);
  ASSERT_TRUE(bench.begin()) << bench.last.message;
  EXPECT_EQ(bench.frames(20).size(), 20U);
}

INSTANTIATE_TEST_SUITE_P(
    EveryKind, FaultyStream,
    testing::Values(
        EndOfStream{T7StreamFault::wrong_transaction, Outcome::lost, "an unknown number of scans"},
        EndOfStream{T7StreamFault::no_packet, Outcome::lost, "expected packets of function 76"},
        EndOfStream{T7StreamFault::overlap, Outcome::needs_attention, "status 2942 (scan overlap"},
        EndOfStream{T7StreamFault::cut, Outcome::lost, "the connection was closed"}));

TEST(LabjackT7, ASilentStreamIsLost) {
  Bench bench;
  ASSERT_TRUE(bench.begin()) << bench.last.message;
  bench.frames(20);
  bench.board.stop_scanning(true);
  const Result end = bench.stream_end();
  EXPECT_EQ(end.outcome, Outcome::lost);
  EXPECT_THAT(end.message, HasSubstr("no scans arrive any more"));
}

TEST(LabjackT7, DrivesTheOutputAndTheEnableLine) {
  Bench bench;
  ASSERT_TRUE(bench.begin()) << bench.last.message;
  EXPECT_FALSE(bench.wires.enabled);
  EXPECT_NEAR(bench.wires.driven, 2.5, 1e-6);
  ASSERT_TRUE(
      bench.until({3.25, true}, [&] { return bench.wires.enabled && bench.wires.driven == 3.25; }));
  ASSERT_TRUE(bench.until({9.0, true}, [&] { return bench.wires.driven == 5.0; })) << "limited";
  ASSERT_TRUE(
      bench.until({2.5, false}, [&] { return !bench.wires.enabled && bench.wires.driven == 2.5; }));
  ASSERT_TRUE(bench.until({2.5, false}, [&] { return static_cast<bool>(bench.last); }));
}

TEST(LabjackT7, RestsAtTheConfiguredVoltageBeforeAnyWrite) {
  config::LabjackT7 chosen = settings();
  chosen.rest_v = 1.25;
  chosen.dac = 1;
  Bench bench(1000.0, chosen, inputs(), {.dac = 1});
  ASSERT_TRUE(bench.driver.open()) << bench.driver.open().message;
  EXPECT_EQ(bench.wires.driven, 1.25);
}

/// The values of the watchdog registers in the order in which they were written, since `from`.
std::vector<EmulatedLabjackT7::Write> watchdog_writes(const Bench& bench, std::size_t from) {
  std::vector<EmulatedLabjackT7::Write> out;
  const auto all = bench.board.writes();
  for (std::size_t i = from; i < all.size(); ++i) {
    if (all[i].address >= 61600 && all[i].address < 61700) out.push_back(all[i]);
  }
  return out;
}

TEST(LabjackT7, WatchdogIsDisabledThenSetThenArmedBeforeTheStream) {
  Bench bench;
  ASSERT_TRUE(bench.driver.open()) << bench.driver.open().message;
  EXPECT_FALSE(bench.board.watchdog_armed());
  const std::size_t before = bench.board.writes().size();
  ASSERT_TRUE(bench.driver.start()) << bench.driver.start().message;
  EXPECT_TRUE(bench.board.watchdog_armed());
  std::vector<EmulatedLabjackT7::Write> writes = watchdog_writes(bench, before);
  ASSERT_GE(writes.size(), 16U);
  EXPECT_EQ(writes.front(), (EmulatedLabjackT7::Write{61600, 0}));
  EXPECT_EQ(writes[14], (EmulatedLabjackT7::Write{61600, 1}));
  EXPECT_EQ(bench.board.number(61604), 1U);           // time
  EXPECT_EQ(bench.board.number(61610), 1U);           // strict: only the key counts
  EXPECT_EQ(bench.board.number(61620), 0U);           // no reset
  EXPECT_EQ(bench.board.number(61630), 1U);           // lines
  EXPECT_EQ(bench.board.number(61632), 0U);           // low
  EXPECT_EQ(bench.board.number(61634), 1U << 2U);     // an output
  EXPECT_EQ(bench.board.number(61636), ~(1U << 2U));  // no other line
  EXPECT_EQ(bench.board.number(61640), 1U);           // DAC0
  EXPECT_EQ(bench.board.real(61642), 2.5F);
  EXPECT_EQ(bench.board.number(61650), 0U);
  const auto all = bench.board.writes();
  const auto place = [&all](EmulatedLabjackT7::Write wanted) {
    return std::find(all.begin(), all.end(), wanted) - all.begin();
  };
  EXPECT_LT(place({61600, 1}), place({4990, 1}));
  bench.driver.stop();
  EXPECT_FALSE(bench.board.watchdog_armed());
  EXPECT_FALSE(bench.board.streaming());
}

TEST(LabjackT7, WatchdogMakesTheOutputsOfADeadDaemonSafe) {
  Bench bench;
  ASSERT_TRUE(bench.begin()) << bench.last.message;
  ASSERT_TRUE(
      bench.until({4.0, true}, [&] { return bench.wires.enabled && bench.wires.driven == 4.0; }));
  const auto end = steady_clock::now() + long_enough;
  while (bench.board.watchdog_trips() == 0 && steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));  // without reads and writes
  }
  EXPECT_GT(bench.board.watchdog_trips(), 0U);
  EXPECT_FALSE(bench.wires.enabled);
  EXPECT_EQ(bench.wires.driven, 2.5);
  // Off until it is switched off and on again.
  ASSERT_TRUE(bench.until({4.0, true}, [&] { return !bench.last; }));
  EXPECT_THAT(bench.last.message, HasSubstr("watchdog"));
  EXPECT_FALSE(bench.wires.enabled);
  ASSERT_TRUE(bench.until({2.5, false}, [&] { return static_cast<bool>(bench.last); }));
  ASSERT_TRUE(bench.until({4.0, true}, [&] { return bench.wires.enabled.load(); }));
}

TEST(LabjackT7, SignalsFollowTheLines) {
  Bench bench;
  ASSERT_TRUE(bench.begin()) << bench.last.message;
  const drivers::Actuation off{2.5, false};
  const auto signals = [&bench] { return bench.driver.signals(); };
  ASSERT_TRUE(
      bench.until(off, [&] { return !signals().emergency_stop && !signals().amplifier_fault; }));
  bench.wires.pressed = true;
  ASSERT_TRUE(bench.until(off, [&] { return signals().emergency_stop; }));
  bench.wires.pressed = false;
  bench.wires.fault = true;
  ASSERT_TRUE(
      bench.until(off, [&] { return signals().amplifier_fault && !signals().emergency_stop; }));
  // Unknown levels count as pressed.
  bench.wires.fault = false;
  ASSERT_TRUE(bench.until(off, [&] { return !signals().amplifier_fault; }));
  bench.board.fault_replies(T7ReplyFault::missing);
  ASSERT_TRUE(
      bench.until(off, [&] { return signals().emergency_stop && signals().amplifier_fault; }));
  bench.board.fault_replies(T7ReplyFault::none);
}

class FaultyReply : public testing::TestWithParam<T7ReplyFault> {};

TEST_P(FaultyReply, IsReportedByWritesUntilOneIsConfirmed) {
  config::LabjackT7 chosen = settings();
  chosen.watchdog_s = 0;
  Bench bench(1000.0, chosen);
  ASSERT_TRUE(bench.begin()) << bench.last.message;
  ASSERT_TRUE(bench.until({3.0, true}, [&] { return bench.wires.enabled.load(); }));
  bench.board.fault_replies(GetParam());
  ASSERT_TRUE(bench.until({3.1, true}, [&] { return !bench.last; }));
  EXPECT_EQ(bench.last.outcome, Outcome::temporary);
  EXPECT_THAT(bench.last.message, HasSubstr("a set-point did not arrive"));
  EXPECT_THAT(bench.last.message, HasSubstr(where(bench)));
  bench.board.fault_replies(T7ReplyFault::none, 0);
  ASSERT_TRUE(bench.until({3.2, true}, [&] { return static_cast<bool>(bench.last); }));
  ASSERT_TRUE(bench.until({3.2, true}, [&] { return std::abs(bench.wires.driven - 3.2) < 1e-6; }));
}

INSTANTIATE_TEST_SUITE_P(EveryKind, FaultyReply,
                         testing::Values(T7ReplyFault::missing, T7ReplyFault::exception,
                                         T7ReplyFault::wrong_transaction,
                                         T7ReplyFault::wrong_length));

TEST(LabjackT7, AClosedConnectionIsLostAndTheSameBoardIsUsedAgain) {
  Bench bench;
  for (int round = 0; round < 2; ++round) {
    SCOPED_TRACE(round);
    ASSERT_TRUE(bench.begin()) << bench.last.message;
    ASSERT_TRUE(bench.until({3.0, true}, [&] { return bench.wires.enabled.load(); }));
    bench.board.unplug();
    EXPECT_EQ(bench.stream_end().outcome, Outcome::lost);
    EXPECT_NE(bench.driver.write({3.0, true}).outcome, Outcome::ok);
    bench.driver.close();
    // It has power, and its watchdog has perhaps not acted yet.
    ASSERT_NE(bench.driver.left_on(), nullptr);
    EXPECT_THAT(bench.driver.left_on(), HasSubstr("Its watchdog acts after 1 s"));
    const Result refused = bench.driver.open();
    EXPECT_EQ(refused.outcome, Outcome::lost);
    EXPECT_THAT(refused.message, HasSubstr("LabJack T7 at " + where(bench) + ": cannot connect"));
    EXPECT_THAT(refused.message, HasSubstr("ping 127.0.0.1"));
    bench.board.plug();
    ASSERT_TRUE(bench.driver.open()) << bench.driver.open().message;
    EXPECT_FALSE(bench.wires.enabled);
    EXPECT_EQ(bench.driver.left_on(), nullptr);
  }
}

TEST(LabjackT7, AnotherBoardInMidRunIsRefusedAndNotTouched) {
  Bench bench;
  ASSERT_TRUE(bench.driver.open());
  bench.driver.close();
  bench.board.become(470099999);
  const std::size_t before = bench.board.writes().size();
  const Result refused = bench.driver.open();
  EXPECT_EQ(refused.outcome, Outcome::needs_attention);
  EXPECT_THAT(refused.message, HasSubstr("#470099999 at " + where(bench)));
  EXPECT_THAT(refused.message, HasSubstr("the run began with #470012345"));
  EXPECT_EQ(bench.board.writes().size(), before);
  bench.board.become(470012345);
  EXPECT_TRUE(bench.driver.open());
}

TEST(LabjackT7, ConfiguredSerialNumberIsChecked) {
  config::LabjackT7 chosen = settings();
  chosen.serial = 5;
  Bench bench(1000.0, chosen);
  const Result refused = bench.driver.open();
  EXPECT_EQ(refused.outcome, Outcome::needs_attention);
  EXPECT_THAT(refused.message, HasSubstr("expected #5 (labjack_t7.serial)"));
  EXPECT_THAT(bench.board.writes(), IsEmpty());
}

TEST(LabjackT7, OtherProductsAndOldFirmwareAreRefused) {
  Bench other(1000.0, settings(), inputs(), {.product = 4.0F});
  EXPECT_THAT(other.driver.open().message, HasSubstr("is product 4, expected 7 (LabJack T7)"));
  Bench old(1000.0, settings(), inputs(), {.firmware = 1.0015F});
  EXPECT_THAT(old.driver.open().message, HasSubstr("firmware 1.0015, expected 1.0186 or later"));
}

TEST(LabjackT7, ImplausibleCalibrationIsRefused) {
  Bench bench;
  bench.board.set_constant(1, 0, 0.0F);
  const Result refused = bench.driver.open();
  EXPECT_EQ(refused.outcome, Outcome::needs_attention);
  EXPECT_THAT(refused.message, HasSubstr("the slope for positive volts of gain 1 is 0"));
}

TEST(LabjackT7, RefusedSettingsAreReportedWithTheBoardsError) {
  Bench bench;
  ASSERT_TRUE(bench.driver.open());
  bench.board.refuse_address(4990, 2608);
  const Result refused = bench.driver.start();
  EXPECT_EQ(refused.outcome, Outcome::needs_attention);
  EXPECT_THAT(refused.message, HasSubstr("error 2608 (too many samples per second)"));
  EXPECT_THAT(refused.message, HasSubstr(where(bench)));
  EXPECT_FALSE(bench.board.watchdog_armed());
  bench.board.refuse_address(4990);
  EXPECT_TRUE(bench.driver.start());
}

TEST(LabjackT7, ADifferentRateOfTheBoardIsRefused) {
  Bench bench;
  bench.board.misreport_rate(1.01);
  EXPECT_FALSE(bench.begin());
  EXPECT_THAT(bench.last.message, HasSubstr("scans at 1010 Hz, expected loop.rate_hz = 1000"));
  EXPECT_FALSE(bench.board.streaming());
}

TEST(LabjackT7, StateLeftByACrashedProcessIsEnded) {
  Bench bench;
  auto dead =
      std::make_unique<LabjackT7Driver>(bench.at_board(settings()), inputs(), 1000.0, bench.clock);
  ASSERT_TRUE(dead->open());
  ASSERT_TRUE(dead->start());
  while (!bench.wires.enabled) {
    Frame frame;
    static_cast<void>(dead->read(frame));
    static_cast<void>(dead->write({3.0, true}));
  }
  bench.board.hang_up();  // without cleanup
  dead.reset();
  ASSERT_TRUE(bench.board.streaming());
  // Whatever fails afterwards, the line is low.
  bench.board.refuse_address(61810, 1);
  EXPECT_FALSE(bench.driver.open());
  EXPECT_FALSE(bench.wires.enabled);
  bench.board.refuse_address(61810);
  ASSERT_TRUE(bench.begin()) << bench.last.message;
  EXPECT_EQ(bench.frames(50).size(), 50U);
}

TEST(LabjackT7, ABoardThatDoesNotAnswerIsReported) {
  Bench bench;
  bench.board.fault_replies(T7ReplyFault::missing);
  const Result refused = bench.driver.open();
  EXPECT_EQ(refused.outcome, Outcome::temporary);
  EXPECT_THAT(refused.message, HasSubstr("cannot identify it: it did not answer within 1 s"));
}

#ifdef STICKSLIP_HEAP_IS_COUNTED
TEST(LabjackT7, ReadAndWriteDoNotUseTheHeap) {
  Bench bench;
  ASSERT_TRUE(bench.begin()) << bench.last.message;
  std::size_t heap_calls = 0;
  for (int i = 0; i < 500; ++i) {
    if (i == 250) bench.board.fault_replies(T7ReplyFault::exception, 20);
    Frame frame;
    heap_count::start();
    static_cast<void>(bench.driver.read(frame));
    static_cast<void>(bench.driver.write({2.0 + 0.001 * i, i % 100 < 90}));
    heap_calls += heap_count::stop();
  }
  EXPECT_EQ(heap_calls, 0U);
}
#endif

// As `stickslip check --live` does it.
TEST(LabjackT7, ABenchIsMadeOfItAndProbed) {
  SineWires wires;
  drivers::MonotonicHostClock clock;
  EmulatedLabjackT7 board(wires, [&clock] { return clock.now_ns(); });
  board.wire(3, {Channel::displacement, 0.0, 1.5});
  config::Bench bench;
  bench.board = config::BoardKind::labjack_t7;
  bench.labjack_t7 = settings();
  bench.labjack_t7.port = board.port();
  bench.labjack_t7.stream_port = board.stream_port();
  bench.inputs[index_of(Channel::velocity)] = {.device = "labjack_t7", .input = "AIN3"};
  const auto probed = drivers::probe_bench(drivers::make_bench_parts(bench, 1000.0), bench, 0.3);
  ASSERT_EQ(probed.size(), 1U);
  EXPECT_TRUE(probed[0].ok) << probed[0].message;
  EXPECT_THAT(probed[0].name, HasSubstr("LabJack T7 #470012345"));
  ASSERT_EQ(probed[0].readings.size(), 1U);
  EXPECT_NEAR(probed[0].readings[0].mean, 1.5, 2e-4);
  EXPECT_FALSE(wires.enabled);
}

TEST(LabjackT7, SettingsAreChecked) {
  drivers::MonotonicHostClock clock;
  const auto error = [&clock](const config::LabjackT7& chosen, double rate_hz = 1000.0) {
    LabjackT7Driver driver(chosen, inputs(), rate_hz, clock);
    const Result refused = driver.open();
    EXPECT_EQ(refused.outcome, Outcome::needs_attention);
    return std::string(refused.message);
  };
  config::LabjackT7 chosen = settings();
  EXPECT_THAT(error(chosen, 60000.0),
              HasSubstr("100000 samples/s over all inputs, so at most 50000"));
  EXPECT_THAT(error(chosen, 47000.0), HasSubstr("The nearest is 46948.3568"));
  chosen.scans_per_packet = 300;
  EXPECT_THAT(error(chosen), HasSubstr("labjack_t7.scans_per_packet = 300: must be 1 to 256"));
  chosen = settings();
  chosen.emergency_stop_line = 2;
  EXPECT_THAT(error(chosen), HasSubstr("labjack_t7.enable_line = 2 is also used as an input"));
  chosen.emergency_stop_line = 23;
  EXPECT_THAT(error(chosen), HasSubstr("lines 0 to 22"));
  chosen = settings();
  chosen.host.clear();
  EXPECT_THAT(error(chosen), HasSubstr("labjack_t7.host is empty"));
}

}  // namespace
}  // namespace stickslip::emulated
