// SPDX-License-Identifier: Apache-2.0
// Outputs that do not follow their commands: the loop of the daemon on an emulated USB-1208FS-Plus
// whose spare inputs read its paced output and the contact of a GPIO chip back.
#include <gtest/gtest.h>

#include <memory>
#include <optional>

#include "drivers/factory/make_bench.h"
#include "tests/emulated/attach/emulated_libusb.h"
#include "tests/emulated/bench/loop_on_a_bench.h"
#include "tests/emulated/gpio/emulated_contact.h"
#include "tests/emulated/gpio/emulated_gpio.h"
#include "tests/emulated/usb_1208fs_plus/emulated_usb_1208fs_plus.h"

namespace stickslip::emulated {
namespace {

using namespace std::chrono_literals;
using daemon::Command;

constexpr const char* chip = "/dev/gpiochip3";
constexpr std::size_t output_terminal = 6;
constexpr std::size_t contact_terminal = 7;

/// Test hosts are busier than those of rigs: long delays, and much drive queued in the board. An
/// output that runs dry time and again does not follow.
config::Bench settings() {
  config::Bench out;
  out.board = config::BoardKind::usb_1208fs_plus;
  out.inputs[index_of(Channel::displacement)] = {"usb_1208fs_plus", "CH0", 10.0, false, 1};
  out.usb_1208fs_plus.output_ahead_s = 0.4;
  out.shaker.volts_per_unit = 150.0;
  out.amplifier.emplace().chip = chip;
  out.amplifier->enable = config::GpioLine{.line = "0"};
  out.amplifier->heartbeat = config::GpioLine{.line = "1"};
  out.readback.drive.emplace().input = {"usb_1208fs_plus", "CH6", 10.0, false, 1};
  out.readback.enable.emplace().input = {"usb_1208fs_plus", "CH7", 10.0, false, 1};
  out.readback.drive->delay_s = 1.2;
  out.readback.enable->delay_s = 0.8;
  return out;
}

struct ReadBackOfAPacedOutput : testing::Test {
  ReadBackOfAPacedOutput() {
    emulated_gpio().clear();
    emulated_gpio().add_chip(chip, "cp2112_gpio", {"enable", "beat"});
    bus.plug(board, 1);
    bench = drivers::make_bench(settings(), 1000.0);
    loop.emplace(*bench);
  }
  EmulatedUsb1208fsPlus::Options board_options() {
    EmulatedUsb1208fsPlus::Options out;
    out.sensors[0] = Sensor{Channel::displacement, 500.0, 0.0};
    out.output_terminal = output_terminal;
    out.contact_terminal = contact_terminal;
    out.contact_closed = [this] { return contact.closed(); };
    return out;
  }
  void set_outputs_stuck(bool stuck) {
    bus.between_calls([this, stuck] { board.set_outputs_stuck(stuck); });
  }
  bool runs() {
    return eventually([this] { return contact.closed() && loop->moves(); });
  }

  HostWatch host;
  drivers::MonotonicHostClock clock;
  EmulatedBus bus;
  Still wires;
  EmulatedContact contact{{.chip = chip, .enable = 0, .heartbeat = 1, .hold_ns = 2'000'000'000},
                          [this] { return clock.now_ns(); }};
  EmulatedUsb1208fsPlus board{board_options(), wires, [this] { return clock.now_ns(); }};
  std::unique_ptr<drivers::Driver> bench;
  std::optional<LoopOnABench> loop;
};

// Also not where the drive that is queued in the board is discarded.
TEST_F(ReadBackOfAPacedOutput, OutputsThatFollowAreNoFault) {
  ASSERT_TRUE(runs()) << loop->cause();
  const auto pass = [this](std::chrono::seconds length) {
    const Interval interval(host, length);
    while (!interval.over()) std::this_thread::sleep_for(10ms);
  };
  pass(5s);
  EXPECT_FALSE(loop->faulted()) << loop->cause();
  EXPECT_TRUE(contact.closed());
  ASSERT_TRUE(loop->ask(Command::Kind::stop));
  ASSERT_TRUE(eventually([this] { return !contact.closed(); }));
  pass(3s);
  EXPECT_FALSE(loop->faulted()) << loop->cause();
}

TEST_F(ReadBackOfAPacedOutput, StuckOutputSwitchesTheAmplifierOffAndIsNamed) {
  ASSERT_TRUE(runs()) << loop->cause();
  set_outputs_stuck(true);
  expect_output_differs(*loop, "the drive reads back as");
  EXPECT_TRUE(eventually([this] { return !contact.closed(); }));
  set_outputs_stuck(false);
}

TEST_F(ReadBackOfAPacedOutput, ContactThatOpensByItselfIsNamed) {
  ASSERT_TRUE(runs()) << loop->cause();
  contact.cut();
  expect_output_differs(*loop, "enable contact");
}

// Off was commanded: what is left is to say so, and to refuse the next start.
TEST_F(ReadBackOfAPacedOutput, WeldedContactIsNamedOnceItIsSwitchedOff) {
  ASSERT_TRUE(runs()) << loop->cause();
  contact.set_welded(true);
  ASSERT_TRUE(loop->ask(Command::Kind::stop));
  expect_output_differs(*loop, "enable contact (1: on) reads back as 1 where 0 was commanded");
  contact.set_welded(false);
}

}  // namespace
}  // namespace stickslip::emulated
