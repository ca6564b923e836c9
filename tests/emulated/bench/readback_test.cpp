// SPDX-License-Identifier: Apache-2.0
// Outputs that do not follow their commands: the loop of the daemon on an emulated LabJack U6 whose
// spare inputs read its outputs back.
#include <gtest/gtest.h>

#include <memory>
#include <optional>

#include "drivers/factory/make_bench.h"
#include "tests/emulated/attach/emulated_libusb.h"
#include "tests/emulated/bench/loop_on_a_bench.h"
#include "tests/emulated/labjack_u6/emulated_labjack_u6.h"

namespace stickslip::emulated {
namespace {

using namespace std::chrono_literals;
using daemon::Command;

config::Bench settings() {
  config::Bench out;
  out.inputs[index_of(Channel::displacement)] = {"labjack_u6", "AIN0", 10.0, false, 1};
  out.labjack_u6.enable_line = 0;
  out.shaker.volts_per_unit = 150.0;
  out.readback.drive.emplace().input = {"labjack_u6", "AIN12", 10.0, false, 1};
  out.readback.enable.emplace().input = {"labjack_u6", "AIN13", 10.0, false, 1};
  // Test hosts are busier than those of rigs.
  out.readback.drive->delay_s = 0.4;
  out.readback.enable->delay_s = 0.4;
  return out;
}

LabjackU6Options board_options() {
  LabjackU6Options out;
  out.enable_line = 0;
  out.drive_input = 12;
  out.enable_input = 13;
  return out;
}

struct ReadBack : testing::Test {
  ReadBack() {
    board.wire(0, {Channel::displacement, 500.0, 0.0});
    bus.plug(board, 1);
    loop.emplace(*bench);
  }
  bool runs() {
    return eventually([this] { return wires.is_on() && loop->moves(); });
  }

  HostWatch host;
  drivers::MonotonicHostClock clock;
  EmulatedBus bus;
  Still wires;
  EmulatedLabjackU6 board{wires, [this] { return clock.now_ns(); }, board_options()};
  std::unique_ptr<drivers::Driver> bench = drivers::make_bench(settings(), 1000.0);
  std::optional<LoopOnABench> loop;
};

TEST_F(ReadBack, OutputsThatFollowAreNoFault) {
  ASSERT_TRUE(runs()) << loop->cause();
  const Interval interval(host, 2s);
  while (!interval.over()) std::this_thread::sleep_for(10ms);
  EXPECT_FALSE(loop->faulted()) << loop->cause();
  EXPECT_TRUE(wires.is_on());
}

TEST_F(ReadBack, StuckOutputSwitchesTheAmplifierOffAndIsNamed) {
  ASSERT_TRUE(runs()) << loop->cause();
  board.set_dac_stuck(true);
  expect_output_differs(*loop, "the drive reads back as");
  EXPECT_TRUE(eventually([this] { return !wires.is_on(); }));
}

TEST_F(ReadBack, ContactThatOpensByItselfIsNamed) {
  ASSERT_TRUE(runs()) << loop->cause();
  board.open_contact();
  expect_output_differs(*loop, "enable contact");
}

// Off was commanded: what is left is to say so, and to refuse the next start.
TEST_F(ReadBack, WeldedContactIsNamedOnceItIsSwitchedOff) {
  ASSERT_TRUE(runs()) << loop->cause();
  board.set_contact_stuck(true);
  ASSERT_TRUE(loop->ask(Command::Kind::stop));
  expect_output_differs(*loop, "enable contact (1: on) reads back as 1 where 0 was commanded");
  board.set_contact_stuck(false);
}

}  // namespace
}  // namespace stickslip::emulated
