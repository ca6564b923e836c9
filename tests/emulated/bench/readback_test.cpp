// SPDX-License-Identifier: Apache-2.0
// Outputs that do not follow their commands: the loop of the daemon on an emulated LabJack U6 whose
// spare inputs read its outputs back.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "daemon/excitation.h"
#include "daemon/ledger.h"
#include "daemon/loop.h"
#include "drivers/factory/make_bench.h"
#include "tests/emulated/attach/emulated_bus.h"
#include "tests/emulated/attach/emulated_libusb.h"
#include "tests/emulated/attach/host_watch.h"
#include "tests/emulated/labjack_u6/emulated_labjack_u6.h"

namespace stickslip::emulated {
namespace {

using namespace std::chrono_literals;
using daemon::Command;
using daemon::Interlock;
using daemon::RigState;
using std::chrono::steady_clock;
using testing::HasSubstr;

/// Nothing moves.
class Still final : public Wires {
 public:
  double truth(Channel, std::int64_t) override { return 1e-3; }
  void drive(double, std::int64_t) override {}
  void enable(bool on, std::int64_t) override { on_ = on; }
  bool is_on() const { return on_; }

 private:
  std::atomic<bool> on_ = false;
};

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

config::Excitation shaking() {
  config::Excitation out;
  out.enabled = true;
  out.carrier_hz = 3.2;
  out.amplitude = 0.009;
  out.ramp_s = 0.2;
  return out;
}

daemon::LoopSettings patient() {
  daemon::LoopSettings out;
  out.start_at_once = true;
  out.live.interlocks.longest_silence_ns = 10'000'000'000;
  return out;
}

struct ReadBack : testing::Test {
  ReadBack() {
    board.wire(0, {Channel::displacement, 500.0, 0.0});
    bus.plug(board, 1);
    const drivers::Result opened = bench->open();
    EXPECT_TRUE(opened) << opened.message;
    loop = std::make_unique<daemon::Loop>(*bench, clock, patient(), daemon::Excitation(shaking()),
                                          nullptr, ledger, std::vector<daemon::Stream*>{});
    thread = std::jthread([this] { loop->run(); });
  }
  ~ReadBack() override {
    loop->request_stop();
    loop->request_stop();
    thread.join();
    bench->close();
  }
  static LabjackU6Options board_options() {
    LabjackU6Options out;
    out.enable_line = 0;
    out.drive_input = 12;
    out.enable_input = 13;
    return out;
  }
  /// False after half a minute.
  static bool eventually(const std::function<bool()>& holds) {
    const auto until = steady_clock::now() + 30s;
    while (!holds()) {
      if (steady_clock::now() > until) return false;
      std::this_thread::sleep_for(5ms);
    }
    return true;
  }
  bool faulted() const { return loop->snapshot().state == RigState::faulted; }
  std::string cause() const { return loop->snapshot().cause.c_str(); }
  bool runs() {
    return eventually([this] { return wires.is_on() && loop->snapshot().drive.value != 0.0; });
  }

  HostWatch host;
  drivers::MonotonicHostClock clock;
  EmulatedBus bus;
  Still wires;
  EmulatedLabjackU6 board{wires, [this] { return clock.now_ns(); }, board_options()};
  std::unique_ptr<drivers::Driver> bench = drivers::make_bench(settings(), 1000.0);
  daemon::Ledger ledger;
  std::unique_ptr<daemon::Loop> loop;
  std::jthread thread;
};

TEST_F(ReadBack, OutputsThatFollowAreNoFault) {
  ASSERT_TRUE(runs()) << cause();
  const Interval interval(host, 2s);
  while (!interval.over()) std::this_thread::sleep_for(10ms);
  EXPECT_FALSE(faulted()) << cause();
  EXPECT_TRUE(wires.is_on());
}

TEST_F(ReadBack, StuckOutputSwitchesTheAmplifierOffAndIsNamed) {
  ASSERT_TRUE(runs()) << cause();
  board.set_dac_stuck(true);
  ASSERT_TRUE(eventually([this] { return faulted(); }));
  EXPECT_EQ(loop->snapshot().interlock, Interlock::output_differs);
  EXPECT_THAT(cause(), HasSubstr("the drive reads back as"));
  EXPECT_TRUE(eventually([this] { return !wires.is_on(); }));
}

TEST_F(ReadBack, ContactThatOpensByItselfIsNamed) {
  ASSERT_TRUE(runs()) << cause();
  board.open_contact();
  ASSERT_TRUE(eventually([this] { return faulted(); }));
  EXPECT_EQ(loop->snapshot().interlock, Interlock::output_differs);
  EXPECT_THAT(cause(), HasSubstr("enable contact"));
}

// Off was commanded: what is left is to say so, and to refuse the next start.
TEST_F(ReadBack, WeldedContactIsNamedOnceItIsSwitchedOff) {
  ASSERT_TRUE(runs()) << cause();
  board.set_contact_stuck(true);
  Command stop;
  stop.kind = Command::Kind::stop;
  ASSERT_TRUE(loop->ask(stop));
  ASSERT_TRUE(eventually([this] { return faulted(); }));
  EXPECT_EQ(loop->snapshot().interlock, Interlock::output_differs);
  EXPECT_THAT(cause(), HasSubstr("enable contact (1: on) reads back as 1 where 0 was commanded"));
  board.set_contact_stuck(false);
}

}  // namespace
}  // namespace stickslip::emulated
