// SPDX-License-Identifier: Apache-2.0
// A complete bench in one program: the real drivers of a LabJack U6 and of a PhidgetBridge on one
// emulated bus, combined as in the daemon.
#include "drivers/bench/bench_driver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <thread>
#include <vector>

#include "drivers/factory/make_bench.h"
#include "tests/emulated/attach/emulated_hidapi.h"
#include "tests/emulated/attach/emulated_libusb.h"
#include "tests/emulated/attach/host_watch.h"
#include "tests/emulated/labjack_u6/emulated_labjack_u6.h"
#include "tests/emulated/phidget_bridge/emulated_phidget_bridge.h"

namespace stickslip::emulated {
namespace {

using drivers::Outcome;
using drivers::Result;
using std::chrono::milliseconds;
using std::chrono::steady_clock;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr double volts_per_second = 0.5;
constexpr double ratio_per_second = 2e-4;

/// All channels grow with time: a value shows the time of its measurement.
class Ramp final : public Wires {
 public:
  explicit Ramp(std::int64_t start_ns) : start_ns_(start_ns) {}
  double truth(Channel, std::int64_t time_ns) override {
    return static_cast<double>(time_ns - start_ns_) * 1e-9;
  }
  void drive(double, std::int64_t) override {}
  void enable(bool, std::int64_t) override {}

  std::int64_t time_of(double seconds) const {
    return start_ns_ + static_cast<std::int64_t>(std::llround(seconds * 1e9));
  }

 private:
  std::int64_t start_ns_;
};

config::Bench settings() {
  config::Bench out;
  out.inputs[index_of(Channel::displacement)] = {"labjack_u6", "AIN0", 10.0, false, 1};
  out.inputs[index_of(Channel::velocity)] = {"labjack_u6", "AIN3", 10.0, false, 1};
  out.inputs[index_of(Channel::friction_force)] = {"phidget_bridge", "0", 10.0, false, 128};
  out.inputs[index_of(Channel::normal_load)] = {"phidget_bridge", "2", 10.0, false, 64};
  return out;
}

constexpr std::uint8_t bit(Channel channel) {
  return static_cast<std::uint8_t>(1U << index_of(channel));
}
constexpr std::uint8_t board_channels = bit(Channel::displacement) | bit(Channel::velocity);
constexpr std::uint8_t bridge_channels = bit(Channel::friction_force) | bit(Channel::normal_load);

struct WholeBench : testing::Test {
  static constexpr double rate_hz = 1000.0;

  WholeBench()
      : wires(clock.now_ns()),
        board(
            wires, [this] { return clock.now_ns(); }, board_options()),
        bridge(bridge_options(), wires, [this] { return clock.now_ns(); }),
        bench(drivers::make_bench(settings(), rate_hz)) {
    board.wire(0, {Channel::displacement, volts_per_second, 0.0});
    board.wire(3, {Channel::velocity, -volts_per_second, 0.0});
    bus.plug(board, 1);
    bus.plug(bridge, 2);
  }
  ~WholeBench() override {
    bench->close();
    EXPECT_EQ(bus.open_handles(), 0);
    EXPECT_EQ(bus.transfers_in_flight(), 0U);
    EXPECT_THAT(bus.misuses(), IsEmpty());
  }
  static LabjackU6Options board_options() {
    LabjackU6Options out;
    out.noise = 0.0;
    return out;
  }
  static EmulatedPhidgetBridge::Options bridge_options() {
    EmulatedPhidgetBridge::Options out;
    out.sensors[0] = Sensor{Channel::friction_force, ratio_per_second, 0.0};
    out.sensors[2] = Sensor{Channel::normal_load, 2 * ratio_per_second, 0.0};
    return out;
  }

  std::vector<Frame> frames(milliseconds time) {
    std::vector<Frame> out;
    const Interval interval(host, time);
    while (!interval.over()) {
      Frame frame;
      last = bench->read(frame);
      if (last) {
        out.push_back(frame);
      } else if (last.outcome != Outcome::no_data && last.outcome != Outcome::temporary) {
        break;
      }
    }
    return out;
  }

  static double value(const Frame& frame, Channel channel) {
    return frame.value[index_of(channel)];
  }
  /// Time of measurement, from the value.
  std::int64_t time_ns(const Frame& frame, Channel channel) const {
    switch (channel) {
      case Channel::displacement:
        return wires.time_of(value(frame, channel) / volts_per_second);
      case Channel::friction_force:
        return wires.time_of(value(frame, channel) / ratio_per_second);
      default:
        return wires.time_of(value(frame, channel) / (2 * ratio_per_second));
    }
  }
  /// Ages are correct if the bridge's channel is older than the board's by the age, with two
  /// exceptions: ages count from the arrival of the report; and scans of the board arrive in
  /// packets of 12, the earliest of which determines the time. For frames between the quartiles: a
  /// busy host occasionally reads a report late, which cannot be detected.
  void expect_ages(const std::vector<Frame>& all) {
    std::vector<double> error_ms;
    std::vector<double> age_ms;
    for (const Frame& frame : all) {
      for (const Channel channel : {Channel::friction_force, Channel::normal_load}) {
        if ((frame.valid & bit(channel)) == 0) continue;
        const double older_ms =
            static_cast<double>(time_ns(frame, Channel::displacement) - time_ns(frame, channel)) *
            1e-6;
        age_ms.push_back(frame.age_us[index_of(channel)] * 1e-3);
        error_ms.push_back(older_ms - age_ms.back());
      }
    }
    ASSERT_GT(error_ms.size(), all.size());
    std::sort(error_ms.begin(), error_ms.end());
    std::sort(age_ms.begin(), age_ms.end());
    const double slack_ms = static_cast<double>(host.worst_ns()) * 1e-6;
    const std::size_t quarter = error_ms.size() / 4;
    EXPECT_GT(error_ms[quarter], -5.0 - slack_ms);
    EXPECT_LT(error_ms[3 * quarter], 10.0 + slack_ms);
    EXPECT_GE(age_ms.front(), 0.0);
    EXPECT_LT(age_ms[3 * quarter], 16.0 + slack_ms);
  }

  HostWatch host;
  drivers::MonotonicHostClock clock;
  EmulatedBus bus;
  Ramp wires;
  EmulatedLabjackU6 board;
  EmulatedPhidgetBridge bridge;
  std::unique_ptr<drivers::Driver> bench;
  Result last;
};

TEST_F(WholeBench, FramesHoldBothDevicesWithCorrectAges) {
  const Result opened = bench->open();
  ASSERT_TRUE(opened) << opened.message;
  EXPECT_EQ(bench->description().channels, board_channels | bridge_channels);
  EXPECT_STREQ(bench->description().unit[index_of(Channel::displacement)], "V");
  EXPECT_STREQ(bench->description().unit[index_of(Channel::friction_force)], "V/V");
  EXPECT_THAT(bench->description().name, testing::AllOf(HasSubstr("U6"), HasSubstr("123456")));
  ASSERT_TRUE(bench->start());
  frames(milliseconds(200));
  const auto all = frames(milliseconds(800));
  ASSERT_GT(all.size(), 700U);
  std::size_t incomplete = 0;
  for (const Frame& frame : all) {
    if (frame.valid != (board_channels | bridge_channels)) ++incomplete;
    EXPECT_NEAR(value(frame, Channel::displacement), -value(frame, Channel::velocity), 2e-3);
  }
  EXPECT_LE(incomplete, all.size() / 50);
  expect_ages(all);
  const auto sigma_us = bench->age_sigma_us();
  EXPECT_GT(sigma_us[index_of(Channel::friction_force)], 0);
  EXPECT_EQ(sigma_us[index_of(Channel::displacement)], 0);
  EXPECT_EQ(bench->signals().lost_device, nullptr);
}

// The loop reads late after the start: the board's scans of that time arrive in a burst. A host
// that is busy just then may interrupt the burst, so one of several starts has to be even.
TEST_F(WholeBench, FirstFramesOfAStreamAreSpacedAsTheyWereMeasured) {
  double worst_step_ms = 1e9;
  double worst_late_ms = 1e9;
  for (int start = 0; start < 5 && (worst_step_ms > 0.2 || worst_late_ms > 15.0); ++start) {
    ASSERT_TRUE(bench->open());
    ASSERT_TRUE(bench->start());
    std::this_thread::sleep_for(milliseconds(60));
    const auto all = frames(milliseconds(200));
    ASSERT_GT(all.size(), 100U);
    EXPECT_EQ(all.front().sequence, 0U);
    worst_step_ms = 0.0;
    worst_late_ms = 0.0;
    for (std::size_t i = 0; i < 60; ++i) {
      const auto step_ns = static_cast<double>(all[i + 1].time_ns - all[i].time_ns);
      const auto late_ns =
          static_cast<double>(all[i].time_ns - time_ns(all[i], Channel::displacement));
      worst_step_ms = std::max(worst_step_ms, std::abs(1e-6 * step_ns - 1.0));
      worst_late_ms = std::max(worst_late_ms, std::abs(1e-6 * late_ns));
    }
    bench->stop();
    bench->close();
  }
  EXPECT_LT(worst_step_ms, 0.2);
  EXPECT_LT(worst_late_ms, 15.0);
}

TEST_F(WholeBench, UnpluggedBridgeLosesItsChannelsAndRecovers) {
  ASSERT_TRUE(bench->open());
  ASSERT_TRUE(bench->start());
  for (int round = 0; round < 2; ++round) {
    SCOPED_TRACE(round);
    ASSERT_GT(frames(milliseconds(250)).size(), 150U);
    bus.unplug(bridge);
    frames(milliseconds(60));
    const auto without = frames(milliseconds(300));
    ASSERT_GT(without.size(), 250U);
    for (const Frame& frame : without) ASSERT_EQ(frame.valid, board_channels);
    for (std::size_t i = 1; i < without.size(); ++i) {
      ASSERT_EQ(without[i].sequence, without[i - 1].sequence + 1);
    }
    ASSERT_NE(bench->signals().lost_device, nullptr);
    EXPECT_THAT(bench->signals().lost_device, HasSubstr("PhidgetBridge"));
    bus.plug(bridge, 2);
    const auto end = steady_clock::now() + milliseconds(1500);
    while (bench->signals().lost_device != nullptr && steady_clock::now() < end) {
      frames(milliseconds(20));
    }
    EXPECT_EQ(bench->signals().lost_device, nullptr);
    frames(milliseconds(100));
    const auto again = frames(milliseconds(200));
    ASSERT_GT(again.size(), 100U);
    std::size_t complete = 0;
    for (const Frame& frame : again) {
      if (frame.valid == (board_channels | bridge_channels)) ++complete;
    }
    EXPECT_GT(complete, again.size() * 9 / 10);
    expect_ages(again);
  }
}

TEST_F(WholeBench, SilentBridgeIsInvalidButNotLost) {
  ASSERT_TRUE(bench->open());
  ASSERT_TRUE(bench->start());
  ASSERT_GT(frames(milliseconds(200)).size(), 100U);
  bus.between_calls([&] { bridge.faults = {.silent = true}; });
  frames(milliseconds(450));
  const auto silent = frames(milliseconds(200));
  ASSERT_GT(silent.size(), 100U);
  for (const Frame& frame : silent) ASSERT_EQ(frame.valid, board_channels);
  EXPECT_EQ(bench->signals().lost_device, nullptr);
  bus.between_calls([&] { bridge.faults = {}; });
  std::vector<Frame> again;
  for (int tenth = 0; tenth < 20; ++tenth) {
    again = frames(milliseconds(100));
    if (!again.empty() && again.back().valid == (board_channels | bridge_channels)) break;
  }
  ASSERT_FALSE(again.empty());
  EXPECT_EQ(again.back().valid, board_channels | bridge_channels);
}

TEST_F(WholeBench, FirstOpenRequiresAllDevicesReopeningOnlyTheBoard) {
  bus.unplug(bridge);
  const Result refused = bench->open();
  EXPECT_EQ(refused.outcome, Outcome::lost);
  EXPECT_THAT(refused.message, HasSubstr("PhidgetBridge"));
  bus.plug(bridge, 2);
  ASSERT_TRUE(bench->open());
  bench->close();
  bus.unplug(bridge);
  ASSERT_TRUE(bench->open());
  ASSERT_TRUE(bench->start());
  const auto all = frames(milliseconds(200));
  ASSERT_GT(all.size(), 50U);
  EXPECT_EQ(all.back().valid, board_channels);
  EXPECT_NE(bench->signals().lost_device, nullptr);
}

TEST_F(WholeBench, UnpluggedBoardLosesTheRigUntilReopened) {
  ASSERT_TRUE(bench->open());
  ASSERT_TRUE(bench->start());
  ASSERT_GT(frames(milliseconds(150)).size(), 50U);
  bus.unplug(board);
  frames(milliseconds(500));
  EXPECT_EQ(last.outcome, Outcome::lost) << last.message;
  bench->stop();
  bench->close();
  bus.plug(board, 3);
  ASSERT_TRUE(bench->open());
  ASSERT_TRUE(bench->start());
  frames(milliseconds(200));
  const auto all = frames(milliseconds(200));
  ASSERT_GT(all.size(), 100U);
  EXPECT_EQ(all.back().valid, board_channels | bridge_channels);
  expect_ages(all);
}

}  // namespace
}  // namespace stickslip::emulated
