// SPDX-License-Identifier: Apache-2.0
// The real driver of the USB-1208FS-Plus with the emulated board on a bus in this program.
#include "drivers/usb_1208fs_plus/usb_1208fs_plus_driver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <numbers>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "tests/emulated/attach/emulated_libusb.h"
#include "tests/emulated/attach/host_watch.h"
#include "tests/emulated/usb_1208fs_plus/emulated_usb_1208fs_plus.h"

namespace stickslip::emulated {
namespace {

using drivers::Outcome;
using drivers::Result;
using drivers::Usb1208fsPlusDriver;
using std::chrono::milliseconds;
using testing::AnyOf;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr double turns_hz = 10.0;

/// Two inputs in quadrature: adjacent scans differ, and the phase of a scan shows its time. To be
/// accessed while the bus is idle.
class SineWires final : public Wires {
 public:
  double truth(Channel channel, std::int64_t time_ns) override {
    const double quarter = channel == Channel::velocity ? 0.25 : 0.0;
    const double turns = turns_hz * static_cast<double>(time_ns) * 1e-9;
    return std::cos(2.0 * std::numbers::pi * (turns - quarter));
  }
  void drive(double volts, std::int64_t time_ns) override { driven.emplace_back(volts, time_ns); }
  void enable(bool, std::int64_t) override {}

  std::vector<std::pair<double, std::int64_t>> driven;
};

config::BenchInputs single_ended() {
  config::BenchInputs out;
  out[index_of(Channel::displacement)] = {.device = "usb_1208fs_plus", .input = "CH0"};
  out[index_of(Channel::velocity)] = {.device = "usb_1208fs_plus", .input = "CH5"};
  return out;
}

EmulatedUsb1208fsPlus::Options board_options(std::uint64_t seed, double amplitude_v,
                                             const config::Usb1208fsPlus& settings = {}) {
  EmulatedUsb1208fsPlus::Options out;
  out.seed = seed;
  out.sensors[0] = Sensor{Channel::displacement, amplitude_v, 0.0};
  out.sensors[5] = Sensor{Channel::velocity, amplitude_v, 0.0};
  out.sensors[6] = Sensor{Channel::velocity, amplitude_v, 0.0};  // CH3 if differential
  if (settings.drive_readback) out.output_terminal = 2;
  if (settings.enable_readback) out.contact_terminal = 7;
  out.contact_closed = [] { return true; };
  return out;
}

struct Bench {
  explicit Bench(std::uint64_t seed = 1, double rate_hz = 5000.0,
                 const config::Usb1208fsPlus& settings = {},
                 const config::BenchInputs& inputs = single_ended(), double amplitude_v = 8.0)
      : board(board_options(seed, amplitude_v, settings), wires, [this] { return clock.now_ns(); }),
        driver(settings, inputs, rate_hz, clock),
        period_ns(1e9 / rate_hz) {
    bus.plug(board, 1);
  }
  ~Bench() {
    driver.close();
    EXPECT_EQ(bus.open_handles(), 0);
    EXPECT_EQ(bus.transfers_in_flight(), 0U);
    EXPECT_THAT(bus.misuses(), IsEmpty());
  }

  void begin() {
    ASSERT_TRUE(driver.open()) << driver.open().message;
    ASSERT_TRUE(driver.start()) << driver.start().message;
  }

  /// Frames of a duration.
  std::vector<Frame> frames(milliseconds time) {
    std::vector<Frame> out;
    const Interval interval(host, time);
    while (!interval.over()) {
      Frame frame;
      last = driver.read(frame);
      if (last) {
        out.push_back(frame);
      } else if (last.outcome == Outcome::temporary) {
        ++reported;
      } else if (last.outcome != Outcome::no_data) {
        break;
      }
    }
    return out;
  }

  void set_faults(const EmulatedUsb1208fsPlus::Faults& faults) {
    bus.between_calls([&] { board.faults = faults; });
  }
  std::vector<Usb1208fsPlusScan> scans() {
    std::vector<Usb1208fsPlusScan> out;
    bus.between_calls([&] { out = board.scans(); });
    return out;
  }
  std::vector<std::pair<double, std::int64_t>> driven() {
    std::vector<std::pair<double, std::int64_t>> out;
    bus.between_calls([&] { out = wires.driven; });
    return out;
  }

  HostWatch host;
  drivers::MonotonicHostClock clock;
  EmulatedBus bus;
  SineWires wires;
  EmulatedUsb1208fsPlus board;
  Usb1208fsPlusDriver driver;
  double period_ns;
  Result last;
  int reported = 0;  // `temporary` outcomes
};

/// Comparison of frames with the scans of the board.
struct Compared {
  std::size_t wrong = 0;     // without a matching scan
  double largest_shift = 0;  // [periods] between a frame's number and the time of its scan
};

/// `half_code_v` is half of the converter's resolution. `which` are the positions of the two
/// channels in the scan.
Compared compare(const std::vector<Frame>& frames, const std::vector<Usb1208fsPlusScan>& scans,
                 double period_ns, double half_code_v, std::array<std::size_t, 2> which = {0, 1}) {
  Compared out;
  const auto fits = [&](const Frame& frame, const Usb1208fsPlusScan& scan) {
    return frame.valid == 0b11 && scan.volts.size() > std::max(which[0], which[1]) &&
           std::abs(frame.value[0] - scan.volts[which[0]]) <= half_code_v &&
           std::abs(frame.value[1] - scan.volts[which[1]]) <= half_code_v;
  };
  for (const Frame& frame : frames) {
    // Scans are ordered by time.
    const double due_ns = static_cast<double>(scans.front().time_ns) +
                          static_cast<double>(frame.sequence) * period_ns;
    const auto at = std::lower_bound(
        scans.begin(), scans.end(), due_ns - 0.5 * period_ns,
        [](const auto& scan, double ns) { return static_cast<double>(scan.time_ns) < ns; });
    const auto middle = at - scans.begin();
    double nearest = 1e9;
    constexpr std::ptrdiff_t far = 250;
    for (std::ptrdiff_t i = std::max<std::ptrdiff_t>(0, middle - far);
         i < std::min<std::ptrdiff_t>(middle + far, std::ssize(scans)); ++i) {
      const Usb1208fsPlusScan& scan = scans[static_cast<std::size_t>(i)];
      if (!fits(frame, scan)) continue;
      const double shift = (static_cast<double>(scan.time_ns) - due_ns) / period_ns;
      if (std::abs(shift) < std::abs(nearest)) nearest = shift;
    }
    if (nearest == 1e9) {
      ++out.wrong;
    } else {
      out.largest_shift = std::max(out.largest_shift, std::abs(nearest));
    }
  }
  return out;
}

constexpr double half_of_11_bits_v = 1.03 * 10.0 / 2048.0;  // slopes are not quite 1

void expect_ascending(const std::vector<Frame>& frames) {
  for (std::size_t i = 1; i < frames.size(); ++i) {
    ASSERT_GT(frames[i].sequence, frames[i - 1].sequence);
    ASSERT_GT(frames[i].time_ns, frames[i - 1].time_ns);
  }
}

TEST(Usb1208fsPlusOnABus, FramesMatchScansByNumber) {
  Bench bench;
  bench.begin();
  EXPECT_THAT(bench.driver.description().name, HasSubstr("01A2B3C4"));
  EXPECT_EQ(bench.driver.description().channels, 0b11);
  EXPECT_TRUE(bench.driver.description().paced);
  EXPECT_TRUE(bench.driver.description().own_clock);
  const std::vector<Frame> frames = bench.frames(milliseconds(500));
  ASSERT_GT(frames.size(), 2000U);
  const auto scans = bench.scans();
  for (std::size_t i = 0; i < frames.size(); ++i) {
    ASSERT_EQ(frames[i].sequence, i);
    ASSERT_NEAR(frames[i].value[0], scans[i].volts[0], half_of_11_bits_v) << i;
    ASSERT_NEAR(frames[i].value[1], scans[i].volts[1], half_of_11_bits_v) << i;
    // The time is that of the last conversion, and the first is a conversion older.
    ASSERT_EQ(frames[i].time_ns, static_cast<std::int64_t>(i) * 200'000 + 100'000);
    ASSERT_EQ(frames[i].age_us[0], 100);
    ASSERT_EQ(frames[i].age_us[1], 0);
  }
  EXPECT_EQ(bench.reported, 0);
  EXPECT_EQ(bench.driver.overruns(), 0U);
}

TEST(Usb1208fsPlusOnABus, FrameRateEqualsTheScanRateForAnyNumberOfInputs) {
  for (const double rate_hz : {50.0, 1000.0, 5000.0}) {
    SCOPED_TRACE(rate_hz);
    Bench bench(1, rate_hz);
    bench.begin();
    const auto frames = bench.frames(milliseconds(300));
    const auto scans = bench.scans();
    ASSERT_GT(scans.size(), 2U);
    const double taken_s = static_cast<double>(scans.back().time_ns - scans.front().time_ns) * 1e-9;
    EXPECT_NEAR(static_cast<double>(scans.size() - 1) / taken_s, rate_hz, 1e-4 * rate_hz);
    EXPECT_GT(frames.size(), static_cast<std::size_t>(0.2 * rate_hz));
    const std::size_t second = rate_hz == 1000.0 ? scans[0].volts.size() - 1 : 1;
    const Compared compared =
        compare(frames, scans, bench.period_ns, half_of_11_bits_v, {0, second});
    EXPECT_EQ(compared.wrong, 0U);
    EXPECT_LT(compared.largest_shift, 0.6);
  }
}

TEST(Usb1208fsPlusOnABus, DifferentialRangesAreCalibratedByTheUnitsConstants) {
  std::uint64_t seed = 10;
  for (const double range_v : {20.0, 10.0, 5.0, 4.0, 2.5, 2.0, 1.25, 1.0}) {
    SCOPED_TRACE(range_v);
    config::BenchInputs inputs;
    inputs[index_of(Channel::displacement)] = {"usb_1208fs_plus", "CH0", range_v, true, 1};
    inputs[index_of(Channel::velocity)] = {"usb_1208fs_plus", "CH3", range_v, true, 1};
    Bench bench(++seed, 4000.0, {}, inputs, 0.9 * range_v);
    bench.begin();
    const auto frames = bench.frames(milliseconds(120));
    ASSERT_GT(frames.size(), 250U);
    const auto scans = bench.scans();
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const double half_v = 0.5 * 1.03 * range_v / 2048.0;
      ASSERT_NEAR(frames[i].value[0], scans[i].volts[0], half_v) << i;
      ASSERT_NEAR(frames[i].value[1], scans[i].volts[1], half_v) << i;
    }
  }
}

// The readings are those of the same scan: an output that follows reads as the paced value.
TEST(Usb1208fsPlusOnABus, OutputsAreReadBackWithTheScans) {
  config::Usb1208fsPlus settings;
  settings.drive_readback = config::BenchInput{.device = "usb_1208fs_plus", .input = "CH2"};
  settings.enable_readback = config::BenchInput{.device = "usb_1208fs_plus", .input = "CH7"};
  Bench bench(1, 1000.0, settings);
  EXPECT_FALSE(bench.driver.output_readings().drive_v);
  bench.begin();
  Frame frame;
  for (int i = 0; i < 300; ++i) {
    if (!bench.driver.read(frame)) continue;
    ASSERT_EQ(frame.valid, 0b11);
    const drivers::OutputReadings outputs = bench.driver.output_readings();
    ASSERT_TRUE(outputs.drive_v && outputs.enable_v);
    const auto scans = bench.scans();
    const std::vector<double>& volts = scans[frame.sequence].volts;  // of CH0, CH2, CH5, CH7
    ASSERT_NEAR(*outputs.drive_v, volts[1], half_of_11_bits_v);
    ASSERT_NEAR(*outputs.enable_v, volts[3], half_of_11_bits_v);
    ASSERT_NEAR(frame.value[1], volts[2], half_of_11_bits_v);
    static_cast<void>(bench.driver.write({i < 150 ? 1.0 : 4.0, true}));
  }
  EXPECT_NEAR(*bench.driver.output_readings().drive_v, 4.0, 2.0 * half_of_11_bits_v);
  EXPECT_EQ(*bench.driver.output_readings().enable_v > 2.0, true);
  bench.driver.stop();
  ASSERT_TRUE(bench.driver.start());
  EXPECT_FALSE(bench.driver.output_readings().drive_v) << "of the run before";
}

// The output

/// One write per frame, with distinct values: volts of 1000, 1001, ... counts.
struct Drive {
  explicit Drive(Bench& bench) : bench_(bench) {}
  void run(milliseconds time, bool check = true) {
    const Interval interval(bench_.host, time);
    while (!interval.over()) {
      Frame frame;
      if (!bench_.driver.read(frame)) continue;
      const Result written = bench_.driver.write({volts(next), true});
      if (check) {
        ASSERT_TRUE(written) << written.message;
      } else if (!written) {
        refusals.emplace_back(written.message);
      }
      frames.push_back(frame);
      written_at_ns.push_back(bench_.clock.now_ns());
      ++next;
    }
  }
  static double volts(int counts) { return counts * 5.0 / 4096.0; }

  int next = 1000;
  std::vector<Frame> frames;
  std::vector<std::int64_t> written_at_ns;
  std::vector<std::string> refusals;

 private:
  Bench& bench_;
};

int counts_of(double volts) { return static_cast<int>(std::lround(volts * 4096.0 / 5.0)); }

TEST(Usb1208fsPlusOnABus, DriveLeavesInOrderEvenlyAndWithTheConfiguredDelay) {
  config::Usb1208fsPlus settings;
  settings.output_ahead_s = 0.04;
  Bench bench(1, 1000.0, settings);
  bench.begin();
  bench.frames(milliseconds(50));
  Drive drive(bench);
  drive.run(milliseconds(1000));
  const auto driven = bench.driven();
  std::vector<std::pair<int, std::int64_t>> out;  // paced values, after the fill
  for (const auto& [volts, time_ns] : driven) {
    if (counts_of(volts) >= 1000 && counts_of(volts) < 2048)
      out.emplace_back(counts_of(volts), time_ns);
  }
  ASSERT_GT(out.size(), 800U);
  EXPECT_EQ(out.front().first, 1000) << "the first value was lost";
  std::size_t fill = 0;
  while (fill < out.size() && out[fill].first == 1000) ++fill;
  EXPECT_LE(fill, 41U);
  std::vector<double> late_ns;
  for (std::size_t i = 1; i < out.size(); ++i) {
    if (i >= fill) {
      ASSERT_EQ(out[i].first, out[i - 1].first + 1) << i;
    }
    ASSERT_NEAR(static_cast<double>(out[i].second - out[i - 1].second), 1e6, 2.0) << i;
    const auto written = static_cast<std::size_t>(out[i].first - 1000);
    if (i < fill) continue;
    late_ns.push_back(static_cast<double>(out[i].second - drive.written_at_ns[written]));
  }
  std::nth_element(late_ns.begin(), late_ns.begin() + std::ssize(late_ns) / 2, late_ns.end());
  const double median_ms = late_ns[late_ns.size() / 2] * 1e-6;
  // Frames arrive in bundles of 8 ms, by which the delay may be less.
  const double slack_ms = static_cast<double>(bench.host.worst_ns()) * 1e-6;
  EXPECT_GT(median_ms, 30.0 - slack_ms);
  EXPECT_LT(median_ms, 50.0 + slack_ms);
  EXPECT_EQ(bench.driver.underruns(), 0U);
  RecordProperty("median_ms", std::to_string(median_ms));
}

TEST(Usb1208fsPlusOnABus, OffRestsImmediatelyAndDiscardsTheQueue) {
  config::Usb1208fsPlus settings;
  settings.output_ahead_s = 0.2;
  Bench bench(1, 1000.0, settings);
  bench.begin();
  Drive drive(bench);
  for (int round = 0; round < 5; ++round) {
    drive.run(milliseconds(120));
    const std::int64_t off_ns = bench.clock.now_ns();
    ASSERT_TRUE(bench.driver.write({1.5, false}));
    std::this_thread::sleep_for(milliseconds(60));
    const auto driven = bench.driven();
    EXPECT_NEAR(driven.back().first, 1.5, 5.0 / 4096.0);
    EXPECT_LT(driven.back().second - off_ns, 20'000'000 + bench.host.worst_ns());
  }
}

TEST(Usb1208fsPlusOnABus, UnderrunIsReportedAndKeepsTheDelay) {
  config::Usb1208fsPlus settings;
  settings.output_ahead_s = 0.03;
  Bench bench(1, 1000.0, settings);
  bench.begin();
  Drive drive(bench);
  drive.run(milliseconds(300));
  for (int round = 0; round < 3; ++round) {
    std::this_thread::sleep_for(milliseconds(250));  // without writes the queue runs dry
    drive.run(milliseconds(200), false);
  }
  EXPECT_GE(bench.driver.underruns(), 3U);
  ASSERT_GE(drive.refusals.size(), 3U);
  EXPECT_THAT(drive.refusals.front(), HasSubstr("ran dry"));
  int settled = 0;
  // It runs dry again if the host is suspended for longer than it is ahead.
  for (int tries = 0; tries < 5; ++tries) {
    drive.refusals.clear();
    settled = drive.next;
    drive.run(milliseconds(400), false);
    if (drive.refusals.empty()) break;
  }
  ASSERT_TRUE(drive.refusals.empty()) << drive.refusals.front();
  const auto driven = bench.driven();
  std::vector<double> late_ms;
  int before = 0;
  for (const auto& [volts, time_ns] : driven) {
    const int counts = counts_of(volts);
    if (counts < settled || counts >= 4095) continue;
    EXPECT_TRUE(before == 0 || counts == before + 1) << counts << " after " << before;
    before = counts;
    late_ms.push_back(static_cast<double>(
                          time_ns - drive.written_at_ns[static_cast<std::size_t>(counts - 1000)]) *
                      1e-6);
  }
  ASSERT_GT(late_ms.size(), 200U);
  std::nth_element(late_ms.begin(), late_ms.begin() + std::ssize(late_ms) / 2, late_ms.end());
  const double slack_ms = static_cast<double>(bench.host.worst_ns()) * 1e-6;
  EXPECT_GT(late_ms[late_ms.size() / 2], 20.0 - slack_ms);
  EXPECT_LT(late_ms[late_ms.size() / 2], 42.0 + slack_ms);
}

TEST(Usb1208fsPlusOnABus, RestsAfterStop) {
  Bench bench(1, 1000.0);
  bench.begin();
  Drive drive(bench);
  drive.run(milliseconds(100));
  bench.driver.stop();
  EXPECT_NEAR(bench.driven().back().first, 2.5, 5.0 / 4096.0);
  EXPECT_TRUE(bench.driver.start());
  EXPECT_GT(bench.frames(milliseconds(150)).size(), 50U);
}

// Losses

/// Tolerance of a number after a loss: a millisecond of scans, at least one, and the delay of the
/// host between reading its clock and sending the command.
double tolerance_periods(double rate_hz, const HostWatch& host) {
  return 1.0 + (1e-3 + static_cast<double>(host.worst_ns()) * 1e-9) * rate_hz;
}

TEST(Usb1208fsPlusOnABus, SuspendedHostLosesAnEstimatedNumberOfScans) {
  Bench bench(3, 10000.0);
  bench.begin();
  std::vector<Frame> frames = bench.frames(milliseconds(200));
  for (int round = 0; round < 3; ++round) {
    bench.set_faults({.silence = true});  // its FIFO is not read and overflows
    std::this_thread::sleep_for(milliseconds(450));
    bench.set_faults({});
    const auto more = bench.frames(milliseconds(150));
    frames.insert(frames.end(), more.begin(), more.end());
  }
  EXPECT_GE(bench.driver.overruns(), 3U);
  EXPECT_GE(bench.reported, 3);
  expect_ascending(frames);
  const Compared compared = compare(frames, bench.scans(), bench.period_ns, half_of_11_bits_v);
  EXPECT_EQ(compared.wrong, 0U) << "of " << frames.size();
  EXPECT_LT(compared.largest_shift, tolerance_periods(10000.0, bench.host));
  RecordProperty("largest_shift", std::to_string(compared.largest_shift));
}

/// Repeated faults of the stream: every frame is a scan, with its number or one close to it.
struct Kind {
  const char* name;
  EmulatedUsb1208fsPlus::Faults faults;
  int inputs = 2;
};
class FaultyPackets : public testing::TestWithParam<Kind> {};

config::BenchInputs three_inputs() {
  config::BenchInputs out = single_ended();
  out[2] = {.device = "usb_1208fs_plus", .input = "CH2"};
  return out;
}

TEST_P(FaultyPackets, CorruptNoFrame) {
  std::uint64_t injected = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE(seed);
    Bench bench(seed, 4000.0, {}, GetParam().inputs == 3 ? three_inputs() : single_ended());
    bench.begin();
    std::vector<Frame> frames = bench.frames(milliseconds(60));
    std::mt19937_64 random(seed);
    for (int round = 0; round < 6; ++round) {
      bench.set_faults(GetParam().faults);
      auto more = bench.frames(milliseconds(10 + random() % 30));
      frames.insert(frames.end(), more.begin(), more.end());
      bench.set_faults({});
      more = bench.frames(milliseconds(20 + random() % 20));
      frames.insert(frames.end(), more.begin(), more.end());
    }
    const auto more = bench.frames(milliseconds(60));
    ASSERT_GT(more.size(), 50U) << bench.last.message;
    frames.insert(frames.end(), more.begin(), more.end());
    bench.bus.between_calls(
        [&] { injected += bench.board.injected().short_packet + bench.board.injected().stall; });
    if (GetParam().inputs == 3) {
      for (Frame& frame : frames) {
        const bool right = frame.valid == 0b111 && std::abs(frame.value[2]) < half_of_11_bits_v;
        frame.valid = right ? 0b11 : 0;
      }
    }
    expect_ascending(frames);
    const std::size_t second = GetParam().inputs == 3 ? 2 : 1;
    const Compared compared =
        compare(frames, bench.scans(), bench.period_ns, half_of_11_bits_v, {0, second});
    EXPECT_EQ(compared.wrong, 0U) << "of " << frames.size();
    EXPECT_LT(compared.largest_shift, tolerance_periods(4000.0, bench.host));
  }
  if (GetParam().faults.silence) return;
  EXPECT_GT(injected, 4U) << "too few faults";
}

INSTANTIATE_TEST_SUITE_P(
    EveryKind, FaultyPackets,
    testing::Values(Kind{"short_packet", {.short_packet = 0.1}},
                    Kind{"short_packet_of_three_inputs", {.short_packet = 0.1}, 3},
                    Kind{"stall", {.stall = true}}, Kind{"silence", {.silence = true}}),
    [](const auto& kind) { return std::string(kind.param.name); });

TEST(Usb1208fsPlusOnABus, ShortPacketOfASingleScanLosesThatScan) {
  Bench bench(5, 100.0);
  bench.begin();
  std::vector<Frame> frames = bench.frames(milliseconds(100));
  bench.set_faults({.short_packet = 0.2});
  auto more = bench.frames(milliseconds(800));
  frames.insert(frames.end(), more.begin(), more.end());
  bench.set_faults({});
  more = bench.frames(milliseconds(100));
  frames.insert(frames.end(), more.begin(), more.end());
  const auto scans = bench.scans();
  std::uint64_t injected = 0;
  bench.bus.between_calls([&] { injected = bench.board.injected().short_packet; });
  ASSERT_GT(injected, 3U);
  for (const Frame& frame : frames) {
    ASSERT_LT(frame.sequence, scans.size());
    EXPECT_NEAR(frame.value[0], scans[frame.sequence].volts[0], half_of_11_bits_v);
    EXPECT_NEAR(frame.value[1], scans[frame.sequence].volts[1], half_of_11_bits_v);
  }
  EXPECT_EQ(frames.back().sequence + 1 - frames.size(), injected);
}

/// The bus neither loses nor repeats packets, by its own numbers and checksums; if a board did, no
/// frame would mix two scans.
TEST(Usb1208fsPlusOnABus, RepeatedPacketMixesNoScans) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    Bench bench(seed, 4000.0);
    bench.begin();
    std::vector<Frame> frames = bench.frames(milliseconds(60));
    bench.set_faults({.repeated_packet = 0.03});
    const auto more = bench.frames(milliseconds(300));
    frames.insert(frames.end(), more.begin(), more.end());
    EXPECT_EQ(compare(frames, bench.scans(), bench.period_ns, half_of_11_bits_v).wrong, 0U);
  }
}

// Lifecycle

TEST(Usb1208fsPlusOnABus, UnpluggedDeviceIsLostAndRecovers) {
  Bench bench;
  for (int round = 0; round < 4; ++round) {
    SCOPED_TRACE(round);
    ASSERT_TRUE(bench.driver.open()) << bench.driver.open().message;
    ASSERT_TRUE(bench.driver.start());
    ASSERT_GT(bench.frames(milliseconds(80)).size(), 20U);
    if (round % 2 == 1) {
      Drive drive(bench);
      drive.run(milliseconds(40));
    }
    bench.bus.unplug(bench.board);
    bench.frames(milliseconds(500));
    EXPECT_EQ(bench.last.outcome, Outcome::lost) << bench.last.message;
    EXPECT_EQ(bench.driver.write({3.0, true}).outcome, Outcome::lost);
    EXPECT_EQ(bench.driver.write({2.5, false}).outcome, Outcome::lost);
    bench.driver.stop();
    bench.driver.close();
    EXPECT_EQ(bench.driver.open().outcome, Outcome::lost);
    bench.driver.close();
    bench.bus.plug(bench.board, 2);
  }
}

/// A board that does not reply to one of its requests, to be unplugged then.
class Pausing final : public UsbDevice {
 public:
  explicit Pausing(UsbDevice& device) : device_(device) {}
  std::atomic<int> pause_at = 0;  // 1: the first
  std::atomic<int> requests = 0;

  Bytes device_descriptor() const override { return device_.device_descriptor(); }
  Bytes configuration_descriptor() const override { return device_.configuration_descriptor(); }
  std::string string(std::uint8_t index) const override { return device_.string(index); }
  UsbAnswer control(const UsbSetup& setup, std::span<const std::uint8_t> out) override {
    if (requests >= pause_at) return {UsbStatus::not_ready, {}};
    if (++requests == pause_at) return {UsbStatus::not_ready, {}};
    return device_.control(setup, out);
  }
  UsbStatus out(std::uint8_t endpoint, std::span<const std::uint8_t> bytes) override {
    return device_.out(endpoint, bytes);
  }
  UsbAnswer in(std::uint8_t endpoint, std::size_t capacity) override {
    return device_.in(endpoint, capacity);
  }
  void clear_halt(std::uint8_t endpoint) override { device_.clear_halt(endpoint); }
  void reset() override { device_.reset(); }

 private:
  UsbDevice& device_;
};

TEST(Usb1208fsPlusOnABus, UnpluggedAtAnyRequestOfOpenAndStartIsLost) {
  Bench bench;
  bench.bus.unplug(bench.board);
  Pausing pausing(bench.board);
  config::Usb1208fsPlus named;
  named.serial = "01A2B3C4";
  int in_open = 0;
  int in_start = 0;
  for (int at = 1; at <= 14; ++at) {
    for (const bool by_serial : {false, true}) {
      SCOPED_TRACE(at);
      pausing.requests = 0;
      pausing.pause_at = at;
      bench.bus.plug(pausing, 1);
      Usb1208fsPlusDriver driver(by_serial ? named : config::Usb1208fsPlus{}, single_ended(),
                                 5000.0, bench.clock);
      std::thread unplugger([&] {
        while (pausing.requests < at) std::this_thread::sleep_for(milliseconds(1));
        bench.bus.unplug(pausing);
      });
      const Result opened = driver.open();
      if (!opened) {
        ++in_open;
        EXPECT_EQ(opened.outcome, Outcome::lost) << opened.message;
      } else if (const Result started = driver.start(); !started) {
        ++in_start;
        EXPECT_EQ(started.outcome, Outcome::lost) << started.message;
      } else {
        Frame frame;
        Result read = driver.read(frame);
        for (int i = 0; i < 5000 && read.outcome != Outcome::lost; ++i) read = driver.read(frame);
        EXPECT_EQ(read.outcome, Outcome::lost) << read.message;
      }
      unplugger.join();
      driver.close();
    }
  }
  EXPECT_GE(in_open, 10);
  EXPECT_GE(in_start, 2);
  bench.bus.plug(bench.board, 1);
  EXPECT_TRUE(bench.driver.open());
}

TEST(Usb1208fsPlusOnABus, DeniedPermissionReportsTheRemedy) {
  Bench bench;
  bench.bus.refuse_access(bench.board);
  const Result result = bench.driver.open();
  EXPECT_EQ(result.outcome, Outcome::needs_attention);
  EXPECT_THAT(result.message, HasSubstr("udev"));
  const auto found = drivers::find_usb_1208fs_plus();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_THAT(found[0].problem, HasSubstr("udev"));
  bench.driver.close();
  bench.bus.refuse_access(bench.board, false);
  EXPECT_TRUE(bench.driver.open());
}

TEST(Usb1208fsPlusOnABus, AnotherBoardInMidRunIsRefused) {
  Bench bench;
  ASSERT_TRUE(bench.driver.open());
  bench.driver.close();
  bench.bus.unplug(bench.board);
  EmulatedUsb1208fsPlus::Options options = board_options(2, 8.0);
  options.serial = "0FFFFFF1";
  EmulatedUsb1208fsPlus other(options, bench.wires, [&] { return bench.clock.now_ns(); });
  bench.bus.plug(other, 1);
  const Result refused = bench.driver.open();
  EXPECT_EQ(refused.outcome, Outcome::needs_attention);
  EXPECT_THAT(refused.message, HasSubstr("#01A2B3C4 is not attached. Attached: 0FFFFFF1"));
  EXPECT_THAT(refused.message, HasSubstr("The run began with it"));
  bench.bus.plug(bench.board, 2);
  EXPECT_TRUE(bench.driver.open());
  bench.driver.close();
  bench.bus.unplug(other);
}

TEST(Usb1208fsPlusOnABus, SerialNumberSelectsTheDevice) {
  config::Usb1208fsPlus settings;
  Bench bench;
  EmulatedUsb1208fsPlus::Options options = board_options(2, 8.0);
  options.serial = "0FFFFFF1";
  EmulatedUsb1208fsPlus other(options, bench.wires, [&] { return bench.clock.now_ns(); });
  bench.bus.plug(other, 2);
  const Result result = bench.driver.open();
  EXPECT_EQ(result.outcome, Outcome::needs_attention);
  EXPECT_THAT(result.message, AllOf(HasSubstr("01A2B3C4"), HasSubstr("0FFFFFF1")));
  EXPECT_EQ(drivers::find_usb_1208fs_plus().size(), 2U);
  for (const char* serial : {"01A2B3C4", "0FFFFFF1"}) {
    settings.serial = serial;
    Usb1208fsPlusDriver driver(settings, single_ended(), 2000.0, bench.clock);
    ASSERT_TRUE(driver.open());
    EXPECT_THAT(driver.description().name, HasSubstr(serial));
  }
  settings.serial = "00000000";
  Usb1208fsPlusDriver neither(settings, single_ended(), 2000.0, bench.clock);
  const Result none = neither.open();
  EXPECT_EQ(none.outcome, Outcome::needs_attention);
  EXPECT_THAT(none.message, HasSubstr("00000000"));
  settings.serial = "0FFFFFF1";
  Usb1208fsPlusDriver driver(settings, single_ended(), 2000.0, bench.clock);
  ASSERT_TRUE(driver.open());
  ASSERT_TRUE(driver.start());
  Frame frame;
  for (int i = 0; i < 100 && !driver.read(frame); ++i) continue;
  driver.close();
  EXPECT_EQ(bench.board.scans().size(), 0U);
  EXPECT_GT(other.scans().size(), 0U);
  bench.bus.unplug(other);
}

TEST(Usb1208fsPlusOnABus, ScanOfACrashedProcessIsEnded) {
  Bench bench;
  bench.bus.between_calls([&] {
    bench.board.control({0x40, 0x11, 0, 0, 14}, Bytes{0, 0, 0, 0, 0, 0, 0, 0, 0, 64, 0, 0, 3, 0});
    bench.board.out(2, Bytes(200, 1));
    bench.board.control({0x40, 0x1A, 0, 0, 9}, Bytes{0, 0, 0, 0, 0, 64, 0, 0, 1});
  });
  std::this_thread::sleep_for(milliseconds(30));
  bench.begin();
  const auto frames = bench.frames(milliseconds(100));
  ASSERT_GT(frames.size(), 300U);
  EXPECT_NEAR(bench.driven().back().first, 2.5, 5.0 / 4096.0);
  auto scans = bench.scans();
  const auto last =
      std::find_if(scans.rbegin(), scans.rend(), [](auto& one) { return one.begins; });
  scans.erase(scans.begin(), last.base() - 1);
  EXPECT_EQ(compare(frames, scans, bench.period_ns, half_of_11_bits_v).wrong, 0U);
}

}  // namespace
}  // namespace stickslip::emulated
