// SPDX-License-Identifier: Apache-2.0
// The real driver of the LabJack U6 with the emulated board on a bus in this program.
#include "drivers/labjack_u6/labjack_u6_driver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>
#include <mutex>
#include <numbers>
#include <set>
#include <thread>
#include <vector>

#include "drivers/labjack_u6/protocol.h"
#include "tests/emulated/attach/emulated_libusb.h"
#include "tests/emulated/labjack_u6/emulated_labjack_u6.h"
#include "tests/emulated/stepped_clock.h"

namespace stickslip::emulated {
namespace {

using drivers::LabjackU6Driver;
using drivers::Outcome;
using drivers::Result;
using std::chrono::milliseconds;
using std::chrono::steady_clock;
using testing::HasSubstr;

constexpr std::int64_t ms = 1'000'000;

/// Two inputs in quadrature, so that consecutive scans differ.
class SineWires final : public Wires {
 public:
  double truth(Channel channel, std::int64_t time_ns) override {
    const double turns = 40.0 * static_cast<double>(time_ns) * 1e-9;
    const double quarter = channel == Channel::velocity ? 0.25 : 0.0;
    return 5.0 * std::sin(2.0 * std::numbers::pi * (turns + quarter));
  }
  void drive(double volts, std::int64_t) override {
    const std::lock_guard lock(mutex);
    driven = volts;
  }
  void enable(bool on, std::int64_t time_ns) override {
    const std::lock_guard lock(mutex);
    if (on != enabled) changed_ns = time_ns;
    enabled = on;
  }
  bool amplifier_fault() const override { return fault; }
  bool emergency_stop() const override { return pressed; }
  bool is_enabled() const {
    const std::lock_guard lock(mutex);
    return enabled;
  }
  double output_v() const {
    const std::lock_guard lock(mutex);
    return driven;
  }

  mutable std::mutex mutex;
  double driven = 0.0;
  bool enabled = false;
  std::int64_t changed_ns = 0;
  std::atomic<bool> fault{false};
  std::atomic<bool> pressed{false};
};

config::LabjackU6 settings() {
  config::LabjackU6 out;
  out.enable_line = 2;
  out.amplifier_fault_line = 3;
  out.emergency_stop_line = 4;
  out.watchdog_s = 1;
  return out;
}

LabjackU6Options board_options(std::uint64_t seed) {
  LabjackU6Options out;
  out.seed = seed;
  out.noise = 0.0;
  out.enable_line = 2;
  out.amplifier_fault_line = 3;
  out.emergency_stop_line = 4;
  return out;
}

config::BenchInputs inputs() {
  config::BenchInputs out;
  out[index_of(Channel::displacement)] = {.device = "labjack_u6", .input = "AIN0"};
  out[index_of(Channel::velocity)] = {.device = "labjack_u6", .input = "AIN3"};
  return out;
}

template <class Clock>
struct BenchOn {
  explicit BenchOn(std::uint64_t seed = 1, double rate_hz = 5000.0,
                   const config::LabjackU6& chosen = settings())
      : board(
            wires, [this] { return clock.now_ns(); }, board_options(seed)),
        driver(chosen, inputs(), rate_hz, clock) {
    board.wire(0, {Channel::displacement});
    board.wire(3, {Channel::velocity});
    bus.plug(board, 1);
  }

  /// Frames of a duration.
  std::vector<Frame> frames(milliseconds time) {
    std::vector<Frame> out;
    const auto end = steady_clock::now() + time;
    while (steady_clock::now() < end) {
      Frame frame;
      last = driver.read(frame);
      if (last) {
        out.push_back(frame);
      } else if (last.outcome != Outcome::no_data && last.outcome != Outcome::temporary) {
        break;
      }
    }
    return out;
  }

  /// Writes until the enable line is as asked. False if the device is lost or it takes seconds: a
  /// busy host may delay any one write.
  bool drive(const drivers::Actuation& wanted) {
    const auto end = steady_clock::now() + std::chrono::seconds(10);
    while (steady_clock::now() < end) {
      Frame frame;
      static_cast<void>(driver.read(frame));
      last = driver.write(wanted);
      if (!last && last.outcome != Outcome::temporary) return false;
      if (last && wires.is_enabled() == wanted.amplifier_on) return true;
    }
    return false;
  }

  Clock clock;
  EmulatedBus bus;
  SineWires wires;
  EmulatedLabjackU6 board;
  LabjackU6Driver driver;
  Result last;
};

using Bench = BenchOn<drivers::MonotonicHostClock>;

/// Time passes in steps, and stands still until the threads of bus and driver have done what is
/// due: false after half a minute.
struct SteppedBench : BenchOn<SteppedClock> {
  using BenchOn::BenchOn;

  bool begin() {
    if (!driver.open() || !driver.start()) return false;
    standing_transfers = bus.transfers_waiting();
    return true;
  }
  /// Every answer was read, and those transfers that receive are submitted again. A command that is
  /// sent or answered in between shows in one of the counts.
  bool is_idle() const {
    return bus.transfers_waiting() == standing_transfers && board.answers_taken() &&
           bus.transfers_waiting() == standing_transfers;
  }
  /// The frames of a time, but for the last ones, in a transfer that is not full. The host empties
  /// the board's buffer in every millisecond.
  bool read(milliseconds time, std::vector<Frame>& out) {
    constexpr std::size_t packet = 25;  // samples
    for (milliseconds passed{0}; passed < time; ++passed) {
      clock.pass(ms);
      board.catch_up();
      if (!eventually([this] { return board.samples_waiting() < packet; })) return false;
    }
    const auto received = [&] {
      Frame frame;
      last = driver.read(frame);
      if (last) out.push_back(frame);
      return static_cast<bool>(last);
    };
    while (received()) {
    }
    return last.outcome == Outcome::no_data;
  }
  /// Writes every millisecond, with a host that is quick. Ends early where `ends` holds; the time
  /// that has passed.
  milliseconds write(
      milliseconds time, const drivers::Actuation& wanted,
      const std::function<bool()>& ends = [] { return false; }) {
    milliseconds passed{0};
    while (passed < time && !ends()) {
      clock.pass(ms);
      ++passed;
      static_cast<void>(driver.write(wanted));
      EXPECT_TRUE(eventually([this] { return is_idle(); }))
          << "the driver does not take the board's answers";
    }
    return passed;
  }
  bool pressed() const { return driver.signals().emergency_stop; }

  std::size_t standing_transfers = 0;
};

/// Every frame matches the scan of its number, within the converter's resolution.
void expect_true(const std::vector<Frame>& frames, const EmulatedLabjackU6& board) {
  const std::vector<U6Scan> scans = board.scans();
  std::size_t wrong = 0;
  for (const Frame& frame : frames) {
    ASSERT_LT(frame.sequence, scans.size());
    const U6Scan& scan = scans[frame.sequence];
    const bool right = frame.valid == 0b11 && !scan.lost &&
                       std::abs(frame.value[0] - scan.volts[0]) < 0.5e-3 &&
                       std::abs(frame.value[1] - scan.volts[1]) < 0.5e-3;
    if (!right) ++wrong;
  }
  EXPECT_EQ(wrong, 0U) << "of " << frames.size();
}

TEST(LabjackU6OnABus, FramesMatchScansByNumber) {
  Bench bench;
  ASSERT_TRUE(bench.driver.open()) << bench.driver.open().message;
  EXPECT_THAT(bench.driver.description().name, HasSubstr("360009876"));
  EXPECT_EQ(bench.driver.description().channels, 0b11);
  ASSERT_TRUE(bench.driver.start());
  const std::vector<Frame> frames = bench.frames(milliseconds(400));
  ASSERT_GT(frames.size(), 1500U);
  expect_true(frames, bench.board);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    ASSERT_EQ(frames[i].sequence, i);
    ASSERT_EQ(frames[i].time_ns, static_cast<std::int64_t>(i) * 200'000);
  }
  bench.driver.stop();
  bench.driver.close();
  EXPECT_FALSE(bench.board.streaming());
  EXPECT_EQ(bench.bus.open_handles(), 0);
  EXPECT_EQ(bench.bus.transfers_in_flight(), 0U);
  EXPECT_THAT(bench.bus.misuses(), testing::IsEmpty());
}

TEST(LabjackU6OnABus, FrameTimeFollowsTheCrystal) {
  Bench bench;
  ASSERT_TRUE(bench.driver.open());
  EXPECT_TRUE(bench.driver.description().own_clock);
  EXPECT_TRUE(bench.driver.description().paced);
}

// Repeated faults of the stream yield no wrong sample, and lose no more than the faulty packets.
class FaultyStream : public testing::TestWithParam<U6StreamFault> {};

TEST_P(FaultyStream, LosesExactlyTheFaultyPackets) {
  std::size_t events = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    Bench bench(seed);
    ASSERT_TRUE(bench.driver.open());
    ASSERT_TRUE(bench.driver.start());
    ASSERT_GT(bench.frames(milliseconds(50)).size(), 0U);
    bench.board.chance(GetParam(), 0.03);
    std::vector<Frame> frames = bench.frames(milliseconds(350));
    bench.board.chance(GetParam(), 0.0);
    const auto more = bench.frames(milliseconds(80));
    frames.insert(frames.end(), more.begin(), more.end());
    const bool stall = GetParam() == U6StreamFault::stall;
    if (stall && bench.last.outcome == Outcome::lost) continue;  // ended and reported
    ASSERT_GT(frames.size(), 300U) << bench.last.message;
    expect_true(frames, bench.board);
    std::set<std::uint64_t> corrupted;
    for (const U6FaultyPacket& packet : bench.board.faulty_packets()) {
      ++events;
      for (std::uint64_t scan = packet.first_scan; scan <= packet.last_scan; ++scan) {
        corrupted.insert(scan);
      }
    }
    for (std::size_t i = 1; i < frames.size(); ++i) {
      ASSERT_GT(frames[i].sequence, frames[i - 1].sequence);
      for (std::uint64_t gone = frames[i - 1].sequence + 1; gone < frames[i].sequence; ++gone) {
        ASSERT_TRUE(corrupted.contains(gone) || bench.board.scans()[gone].lost)
            << "scan " << gone << " was lost unnecessarily";
      }
    }
  }
  if (GetParam() != U6StreamFault::stall) {
    EXPECT_GT(events, 4U) << "too few faults";
  }
}

INSTANTIATE_TEST_SUITE_P(EveryKind, FaultyStream,
                         testing::Values(U6StreamFault::bad_checksum8,
                                         U6StreamFault::bad_checksum16, U6StreamFault::short_packet,
                                         U6StreamFault::lost, U6StreamFault::repeated,
                                         U6StreamFault::stall));

TEST(LabjackU6OnABus, SuspendedHostLosesACountedNumberOfScans) {
  SteppedBench bench(3, 20000.0);
  ASSERT_TRUE(bench.begin());
  std::vector<Frame> frames;
  ASSERT_TRUE(bench.read(milliseconds(60), frames)) << bench.last.message;
  bench.board.set_silent(true);  // its FIFO is not read and overflows
  bench.clock.pass(120 * ms);
  bench.board.catch_up();
  bench.board.set_silent(false);
  const std::size_t before = frames.size();
  ASSERT_TRUE(bench.read(milliseconds(100), frames)) << bench.last.message;
  EXPECT_GT(bench.board.scans_lost(), 1000U);
  ASSERT_GT(frames.size(), before + 1000);
  expect_true(frames, bench.board);
  std::uint64_t missing = 0;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    missing += frames[i].sequence - frames[i - 1].sequence - 1;
  }
  EXPECT_EQ(missing, bench.board.scans_lost());

  const auto count = [&bench](const std::string& name) {
    const drivers::Counts counts = bench.driver.counts();
    for (const drivers::Count& one : counts.all()) {
      if (one.name == name) return one.value;
    }
    return std::uint64_t{0xDEAD};
  };
  const std::uint64_t overflows = bench.board.recoveries();
  const std::uint64_t thrown_away = bench.board.scans_lost();
  EXPECT_EQ(count("overflows"), overflows);
  EXPECT_EQ(count("scans_thrown_away"), thrown_away);
  EXPECT_EQ(count("scans_lost"), thrown_away);
  EXPECT_EQ(count("packets_lost"), 0U);
  EXPECT_GT(count("fullest_backlog_of_256"), 128U);
  // Counters continue in the next stream, also after reopening.
  bench.driver.stop();
  bench.driver.close();
  EXPECT_EQ(count("overflows"), overflows);
  ASSERT_TRUE(bench.begin());
  frames.clear();
  ASSERT_TRUE(bench.read(milliseconds(20), frames)) << bench.last.message;
  bench.board.schedule(U6StreamFault::lost, bench.board.packets() + 2);
  ASSERT_TRUE(bench.read(milliseconds(30), frames)) << bench.last.message;
  EXPECT_EQ(count("overflows"), overflows);
  EXPECT_EQ(count("packets_lost"), 1U);
  EXPECT_GT(count("scans_lost"), thrown_away);
}

TEST(LabjackU6OnABus, DrivesTheOutputAndTheEnableLine) {
  Bench bench(1, 1000.0);
  ASSERT_TRUE(bench.driver.open());
  ASSERT_TRUE(bench.driver.start());
  EXPECT_FALSE(bench.wires.is_enabled());
  ASSERT_TRUE(bench.drive({3.25, true})) << bench.last.message;
  EXPECT_NEAR(bench.wires.output_v(), 3.25, 5.0 / 4096.0);
  EXPECT_TRUE(bench.drive({2.5, false})) << bench.last.message;
}

TEST(LabjackU6OnABus, RestsAtTheConfiguredVoltageBeforeAnyWrite) {
  config::LabjackU6 chosen = settings();
  chosen.rest_v = 1.25;
  Bench bench(1, 1000.0, chosen);
  ASSERT_TRUE(bench.driver.open());
  EXPECT_NEAR(bench.wires.output_v(), 1.25, 5.0 / 4096.0);
  ASSERT_TRUE(bench.driver.start());
  bench.frames(milliseconds(60));
  EXPECT_NEAR(bench.wires.output_v(), 1.25, 5.0 / 4096.0);
  bench.driver.stop();
  EXPECT_NEAR(bench.wires.output_v(), 1.25, 5.0 / 4096.0);
}

// No source states that the firmware accepts a setting of the watchdog while it streams.
TEST(LabjackU6OnABus, WatchdogIsArmedBeforeTheStreamAndDisarmedAfterIt) {
  Bench bench(1, 1000.0);
  ASSERT_TRUE(bench.driver.open());
  EXPECT_FALSE(bench.board.watchdog_armed());
  ASSERT_TRUE(bench.driver.start());
  EXPECT_TRUE(bench.board.watchdog_armed());
  for (int round = 0; round < 2; ++round) {
    ASSERT_TRUE(bench.drive({3.0, true})) << bench.last.message;
    ASSERT_TRUE(bench.drive({2.5, false})) << bench.last.message;
    EXPECT_TRUE(bench.board.watchdog_armed());
  }
  bench.driver.stop();
  EXPECT_FALSE(bench.board.watchdog_armed());
}

// The off state may last longer than the watchdog waits.
TEST(LabjackU6OnABus, AmplifierIsEnabledAfterALongSilence) {
  Bench bench(1, 1000.0);
  ASSERT_TRUE(bench.driver.open());
  ASSERT_TRUE(bench.driver.start());
  std::this_thread::sleep_for(milliseconds(1300));  // without reads and writes
  const auto end = steady_clock::now() + milliseconds(500);
  while (steady_clock::now() < end) {
    Frame frame;
    static_cast<void>(bench.driver.read(frame));
    static_cast<void>(bench.driver.write({3.0, true}));
  }
  EXPECT_TRUE(bench.wires.is_enabled());
}

TEST(LabjackU6OnABus, WatchdogReleasesTheLineOfACrashedDaemon) {
  Bench bench(1, 1000.0);
  ASSERT_TRUE(bench.driver.open());
  ASSERT_TRUE(bench.driver.start());
  for (int i = 0; i < 200; ++i) {
    Frame frame;
    static_cast<void>(bench.driver.read(frame));
    static_cast<void>(bench.driver.write({3.0, true}));
  }
  ASSERT_TRUE(bench.wires.is_enabled());
  std::this_thread::sleep_for(milliseconds(1300));  // without reads and writes
  bench.board.catch_up();
  EXPECT_GT(bench.board.watchdog_trips(), 0U);
  EXPECT_FALSE(bench.wires.is_enabled());
}

TEST(LabjackU6OnABus, UnconfirmedOffIsReportedAtStop) {
  Bench bench(1, 1000.0);
  ASSERT_TRUE(bench.driver.open());
  ASSERT_TRUE(bench.driver.start());
  bench.frames(milliseconds(50));
  bench.driver.stop();
  EXPECT_EQ(bench.driver.left_on(), nullptr);
  ASSERT_TRUE(bench.driver.start());
  bench.frames(milliseconds(50));
  bench.board.set_silent(true);
  bench.driver.stop();
  bench.driver.close();
  ASSERT_NE(bench.driver.left_on(), nullptr);
  EXPECT_THAT(bench.driver.left_on(), HasSubstr("360009876"));
  EXPECT_THAT(bench.driver.left_on(), HasSubstr("press the emergency stop"));
  bench.board.set_silent(false);
  ASSERT_TRUE(bench.driver.open());
  EXPECT_EQ(bench.driver.left_on(), nullptr);
}

TEST(LabjackU6OnABus, UnchangedDriveFeedsTheWatchdog) {
  Bench bench(1, 1000.0);
  ASSERT_TRUE(bench.driver.open());
  ASSERT_TRUE(bench.driver.start());
  const auto end = steady_clock::now() + milliseconds(1500);
  while (steady_clock::now() < end) {
    Frame frame;
    static_cast<void>(bench.driver.read(frame));
    ASSERT_TRUE(bench.driver.write({3.0, true}));
  }
  EXPECT_EQ(bench.board.watchdog_trips(), 0U);
  EXPECT_TRUE(bench.wires.is_enabled());
}

TEST(LabjackU6OnABus, SignalsFollowTheLinesWithoutADrive) {
  Bench bench(1, 1000.0);
  ASSERT_TRUE(bench.driver.open());
  ASSERT_TRUE(bench.driver.start());
  const auto cycles = [&bench](int count) {
    for (int i = 0; i < count; ++i) {
      Frame frame;
      static_cast<void>(bench.driver.read(frame));
      static_cast<void>(bench.driver.write({2.5, false}));
    }
  };
  cycles(100);
  EXPECT_FALSE(bench.driver.signals().emergency_stop);
  EXPECT_FALSE(bench.driver.signals().amplifier_fault);
  bench.wires.pressed = true;
  cycles(100);
  EXPECT_TRUE(bench.driver.signals().emergency_stop);
  bench.wires.pressed = false;
  bench.wires.fault = true;
  cycles(100);
  EXPECT_FALSE(bench.driver.signals().emergency_stop);
  EXPECT_TRUE(bench.driver.signals().amplifier_fault);
}

TEST(LabjackU6OnABus, UnpluggedDeviceIsLostAndRecovers) {
  Bench bench;
  for (int round = 0; round < 4; ++round) {
    SCOPED_TRACE(round);
    ASSERT_TRUE(bench.driver.open()) << bench.driver.open().message;
    ASSERT_TRUE(bench.driver.start());
    ASSERT_GT(bench.frames(milliseconds(60)).size(), 100U);
    bench.bus.unplug(bench.board);
    bench.frames(milliseconds(500));
    EXPECT_EQ(bench.last.outcome, Outcome::lost) << bench.last.message;
    EXPECT_NE(bench.driver.write({3.0, true}).outcome, Outcome::ok);
    bench.driver.stop();
    bench.driver.close();
    EXPECT_EQ(bench.driver.open().outcome, Outcome::lost);
    bench.driver.close();
    bench.bus.plug(bench.board, 2);
  }
  EXPECT_EQ(bench.bus.open_handles(), 0);
  EXPECT_THAT(bench.bus.misuses(), testing::IsEmpty());
}

TEST(LabjackU6OnABus, DeniedPermissionReportsTheRemedy) {
  Bench bench;
  bench.bus.refuse_access(bench.board);
  const Result result = bench.driver.open();
  EXPECT_EQ(result.outcome, Outcome::needs_attention);
  EXPECT_THAT(result.message, HasSubstr("udev"));
  EXPECT_THAT(result.message, HasSubstr("sudo usermod -aG stickslip $USER"));
  bench.driver.close();
  bench.bus.refuse_access(bench.board, false);
  EXPECT_TRUE(bench.driver.open());
}

TEST(LabjackU6OnABus, SerialNumberSelectsTheDevice) {
  Bench bench;
  LabjackU6Options options = board_options(2);
  options.serial = 360001111;
  EmulatedLabjackU6 other(
      bench.wires, [&bench] { return bench.clock.now_ns(); }, options);
  bench.bus.plug(other, 2);
  const Result several = bench.driver.open();
  EXPECT_EQ(several.outcome, Outcome::needs_attention);
  EXPECT_STREQ(several.message,
               "several LabJack U6 are attached (360009876, 360001111). Select one with serial = "
               "... in [labjack_u6]");
  EXPECT_EQ(drivers::find_labjack_u6().size(), 2U);
  config::LabjackU6 chosen = settings();
  for (const std::uint32_t serial : {360009876U, 360001111U}) {
    chosen.serial = serial;
    LabjackU6Driver driver(chosen, inputs(), 5000.0, bench.clock);
    ASSERT_TRUE(driver.open());
    EXPECT_THAT(driver.description().name, HasSubstr(std::to_string(serial)));
  }
  chosen.serial = 1;
  LabjackU6Driver neither(chosen, inputs(), 5000.0, bench.clock);
  EXPECT_STREQ(neither.open().message,
               "LabJack U6 #1 is not attached. Attached: 360009876, 360001111");
  // The selected board may be the one without permission.
  bench.bus.refuse_access(other);
  EXPECT_THAT(neither.open().message, HasSubstr("70-stickslip.rules"));
}

// Without a configured serial number: another board has other wires and another calibration.
TEST(LabjackU6OnABus, AnotherBoardInMidRunIsRefused) {
  Bench bench;
  ASSERT_TRUE(bench.driver.open());
  bench.driver.close();
  bench.bus.unplug(bench.board);
  LabjackU6Options options = board_options(2);
  options.serial = 360001111;
  EmulatedLabjackU6 other(
      bench.wires, [&bench] { return bench.clock.now_ns(); }, options);
  bench.bus.plug(other, 1);
  const Result refused = bench.driver.open();
  EXPECT_EQ(refused.outcome, Outcome::needs_attention);
  EXPECT_STREQ(refused.message,
               "LabJack U6 #360009876 is not attached. Attached: 360001111. The run began with it: "
               "plug it in again, or restart the daemon to use another");
  bench.bus.plug(bench.board, 2);
  ASSERT_TRUE(bench.driver.open()) << "beside the other one";
  EXPECT_THAT(bench.driver.description().name, HasSubstr("360009876"));
  bench.driver.close();
  bench.bus.unplug(other);
}

TEST(LabjackU6OnABus, StreamOfACrashedProcessIsEnded) {
  Bench bench;
  {
    LabjackU6Driver dead(settings(), inputs(), 5000.0, bench.clock);
    ASSERT_TRUE(dead.open());
    ASSERT_TRUE(dead.start());
    bench.bus.unplug(bench.board);  // without cleanup
  }
  // The board was not reset, as it stayed plugged in.
  bench.bus.plug(bench.board, 1);
  ASSERT_TRUE(bench.driver.open());
  ASSERT_TRUE(bench.driver.start());
  EXPECT_GT(bench.frames(milliseconds(100)).size(), 300U);
}

/// Result of writing and reading for a time: the number of failures, and if a write returned `ok`
/// after the first.
struct Report {
  int failures = 0;
  int ok_after = 0;
};
Report drive(Bench& bench, milliseconds time, drivers::Actuation wanted) {
  Report reported;
  const auto end = steady_clock::now() + time;
  while (steady_clock::now() < end) {
    Frame frame;
    static_cast<void>(bench.driver.read(frame));
    const Result written = bench.driver.write(wanted);
    if (!written) {
      EXPECT_STRNE(written.message, "");
      ++reported.failures;
    } else if (reported.failures > 0) {
      ++reported.ok_after;
    }
  }
  return reported;
}

TEST(LabjackU6OnABus, DeadCommandPathIsReportedByEveryWriteUntilRecovery) {
  for (const bool off : {false, true}) {
    SCOPED_TRACE(off);
    config::LabjackU6 chosen = settings();
    chosen.watchdog_s = 0;
    Bench bench(1, 1000.0, chosen);
    ASSERT_TRUE(bench.driver.open());
    ASSERT_TRUE(bench.driver.start());
    drive(bench, milliseconds(200), {3.0, true});
    bench.board.chance(U6ReplyFault::missing, 1.0);
    const Report reported = drive(bench, milliseconds(900), {off ? 2.5 : 3.0, !off});
    EXPECT_GT(reported.failures, 10);
    EXPECT_EQ(reported.ok_after, 0);
    bench.board.chance(U6ReplyFault::missing, 0.0);
    drive(bench, milliseconds(600), {off ? 2.5 : 3.0, !off});
    EXPECT_TRUE(bench.driver.write({off ? 2.5 : 3.0, !off}));
  }
}

TEST(LabjackU6OnABus, UnknownLinesCountAsPressed) {
  Bench bench(1, 1000.0);
  ASSERT_TRUE(bench.driver.open());
  ASSERT_TRUE(bench.driver.start());
  EXPECT_FALSE(bench.driver.signals().emergency_stop);
  EXPECT_FALSE(bench.driver.signals().amplifier_fault);
  drive(bench, milliseconds(300), {3.0, true});
  EXPECT_FALSE(bench.driver.signals().emergency_stop);
  bench.board.chance(U6ReplyFault::missing, 1.0);
  drive(bench, milliseconds(200), {3.0, true});
  EXPECT_TRUE(bench.driver.signals().emergency_stop);
  EXPECT_TRUE(bench.driver.signals().amplifier_fault);
  bench.board.chance(U6ReplyFault::missing, 0.0);
  drive(bench, milliseconds(400), {3.0, true});
  EXPECT_FALSE(bench.driver.signals().emergency_stop);
  bench.driver.stop();
  EXPECT_FALSE(bench.driver.signals().emergency_stop);
}

TEST(LabjackU6OnABus, SingleLostReplyIsNoEmergencyStop) {
  for (const bool on : {false, true}) {
    SCOPED_TRACE(on);
    SteppedBench bench(1, 1000.0);
    ASSERT_TRUE(bench.begin());
    for (int round = 0; round < 4; ++round) {
      bench.write(milliseconds(60 + 5 * round), {3.0, on});
      ASSERT_FALSE(bench.pressed());
      const std::uint64_t commands = bench.board.commands();
      bench.board.schedule(U6ReplyFault::missing);
      const milliseconds time(300);
      EXPECT_EQ(bench.write(time, {3.0, on}, [&bench] { return bench.pressed(); }), time);
      EXPECT_GT(bench.board.commands(), commands + 1);
    }
  }
}

TEST(LabjackU6OnABus, EmergencyStopIsDetectedWhileALostReplyIsAwaited) {
  SteppedBench bench(1, 1000.0);
  ASSERT_TRUE(bench.begin());
  bench.write(milliseconds(100), {3.0, true});
  bench.board.schedule(U6ReplyFault::missing);
  bench.write(milliseconds(30), {3.0, true});
  ASSERT_FALSE(bench.pressed());
  bench.wires.pressed = true;
  const auto found =
      bench.write(milliseconds(400), {3.0, true}, [&bench] { return bench.pressed(); });
  EXPECT_LE(found, milliseconds(100));
}

// The limit: with any loss of replies, unknown lines count as pressed.
TEST(LabjackU6OnABus, SilentBoardCountsAsPressedAfterATenthOfASecond) {
  SteppedBench bench(1, 1000.0);
  ASSERT_TRUE(bench.begin());
  bench.write(milliseconds(100), {3.0, true});
  ASSERT_FALSE(bench.pressed());
  bench.board.chance(U6ReplyFault::missing, 1.0);
  const auto found =
      bench.write(milliseconds(1000), {3.0, true}, [&bench] { return bench.pressed(); });
  EXPECT_GE(found, milliseconds(80));  // the levels were up to 20 ms old
  EXPECT_LE(found, milliseconds(101));
}

// Unconfirmed commands do not feed the watchdog, as the board may not have received them.
TEST(LabjackU6OnABus, TrippedAmplifierStaysOffUntilAnOffCommand) {
  Bench bench(1, 1000.0);
  ASSERT_TRUE(bench.driver.open());
  ASSERT_TRUE(bench.driver.start());
  for (int tenth = 0; tenth < 20 && !bench.wires.is_enabled(); ++tenth) {
    drive(bench, milliseconds(100), {3.0, true});
  }
  ASSERT_TRUE(bench.wires.is_enabled());
  bench.board.chance(U6ReplyFault::error, 1.0, {.error = 96});
  drive(bench, milliseconds(1200), {3.0, true});
  bench.board.chance(U6ReplyFault::error, 0.0);
  drive(bench, milliseconds(400), {3.0, true});
  EXPECT_FALSE(bench.wires.is_enabled());
  EXPECT_THAT(bench.driver.write({3.0, true}).message, HasSubstr("watchdog"));
  drive(bench, milliseconds(100), {2.5, false});
  for (int tenth = 0; tenth < 20 && !bench.wires.is_enabled(); ++tenth) {
    drive(bench, milliseconds(100), {3.0, true});
  }
  EXPECT_TRUE(bench.wires.is_enabled());
}

/// The state left by a process that died with the amplifier on and without a watchdog.
void leave_line_high(Bench& bench) {
  const auto high = drivers::labjack_u6::Feedback(200).set_line(2, true).command();
  ASSERT_EQ(bench.board.out(1, high.view()), UsbStatus::ok);
  ASSERT_TRUE(bench.wires.is_enabled());
}

// Whichever command of open fails, a line left high by a crashed process is set low.
TEST(LabjackU6OnABus, LineLeftHighByACrashedProcessIsLowWhateverFails) {
  int failures = 0;
  for (std::uint64_t failing = 0; failing < 12; ++failing) {
    SCOPED_TRACE(failing);
    Bench bench(1, 1000.0);
    leave_line_high(bench);
    bench.board.schedule(U6ReplyFault::error, failing, {.error = 96});
    if (!bench.driver.open()) ++failures;
    EXPECT_FALSE(bench.wires.is_enabled());
  }
  EXPECT_GT(failures, 5);
}

TEST(LabjackU6OnABus, LineLeftHighIsSetLowEvenIfTheBoardNeverReplies) {
  Bench bench;
  leave_line_high(bench);
  bench.board.chance(U6ReplyFault::missing, 1.0);
  EXPECT_FALSE(bench.driver.open());
  EXPECT_FALSE(bench.wires.is_enabled());
}

/// Random faults of replies while driving are reported and do not block.
class FaultyReply : public testing::TestWithParam<U6ReplyFault> {};

TEST_P(FaultyReply, IsReportedAndDoesNotBlockTheDrive) {
  Bench bench(2, 1000.0);
  ASSERT_TRUE(bench.driver.open());
  ASSERT_TRUE(bench.driver.start());
  bench.board.chance(GetParam(), 0.05, {.late_ns = 30 * ms, .error = 96});
  int refused = 0;
  const auto end = steady_clock::now() + milliseconds(1200);
  double volts = 1.0;
  auto longest = steady_clock::duration::zero();
  while (steady_clock::now() < end) {
    Frame frame;
    // After a loss calls return immediately; a spinning loop would starve others.
    if (bench.driver.read(frame).outcome == Outcome::lost) {
      std::this_thread::sleep_for(milliseconds(1));
    }
    volts = volts > 4.0 ? 1.0 : volts + 0.01;
    const auto before = steady_clock::now();
    const Result written = bench.driver.write({volts, true});
    longest = std::max(longest, steady_clock::now() - before);
    if (!written) {
      ++refused;
      EXPECT_NE(std::string(written.message), "");
    }
    ASSERT_NE(bench.last.outcome, Outcome::fatal);
  }
  if (GetParam() != U6ReplyFault::late) {
    EXPECT_GT(refused, 0);
  }
  EXPECT_LT(longest, milliseconds(50)) << "a write blocked";
  // The drive recovers with the replies.
  bench.board.chance(GetParam(), 0.0);
  bench.frames(milliseconds(300));
  if (bench.last.outcome == Outcome::lost) {  // only a stalled endpoint ends it
    EXPECT_EQ(GetParam(), U6ReplyFault::stall);
    bench.driver.close();
    ASSERT_TRUE(bench.driver.open());
    ASSERT_TRUE(bench.driver.start());
  }
  const auto again = steady_clock::now() + milliseconds(1500);
  while (steady_clock::now() < again) {
    Frame frame;
    static_cast<void>(bench.driver.read(frame));
    static_cast<void>(bench.driver.write({2.0, true}));
  }
  EXPECT_TRUE(bench.driver.write({2.0, true}));
  EXPECT_NEAR(bench.wires.output_v(), 2.0, 5.0 / 4096.0);
}

INSTANTIATE_TEST_SUITE_P(EveryKind, FaultyReply,
                         testing::Values(U6ReplyFault::late, U6ReplyFault::missing,
                                         U6ReplyFault::error, U6ReplyFault::bad_checksum,
                                         U6ReplyFault::stall));

}  // namespace
}  // namespace stickslip::emulated
