// SPDX-License-Identifier: Apache-2.0
// The loop of the daemon on a bench of emulated devices, in a thread of its own.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "daemon/excitation.h"
#include "daemon/ledger.h"
#include "daemon/loop.h"
#include "drivers/driver.h"
#include "tests/emulated/attach/emulated_bus.h"
#include "tests/emulated/attach/host_watch.h"
#include "tests/emulated/stepped_clock.h"
#include "tests/emulated/wires.h"

namespace stickslip::emulated {

/// Cleared, armed and started at once; test hosts may be silent for long.
class LoopOnABench {
 public:
  /// `bench` is closed, and outlives the loop.
  explicit LoopOnABench(drivers::Driver& bench) : bench_(bench) {
    const drivers::Result opened = bench_.open();
    EXPECT_TRUE(opened) << opened.message;
    daemon::LoopSettings settings;
    settings.start_at_once = true;
    settings.live.interlocks.longest_silence_ns = 10'000'000'000;
    config::Excitation shaking;
    shaking.enabled = true;
    shaking.carrier_hz = 3.2;
    shaking.amplitude = 0.009;
    shaking.ramp_s = 0.2;
    loop_ = std::make_unique<daemon::Loop>(bench_, clock_, settings, daemon::Excitation(shaking),
                                           nullptr, ledger_, std::vector<daemon::Stream*>{});
    thread_ = std::jthread([this] { loop_->run(); });
  }
  LoopOnABench(const LoopOnABench&) = delete;
  LoopOnABench& operator=(const LoopOnABench&) = delete;
  ~LoopOnABench() {
    loop_->request_stop();
    loop_->request_stop();
    thread_.join();
    bench_.close();
  }

  daemon::Snapshot now() const { return loop_->snapshot(); }
  bool faulted() const { return now().state == daemon::RigState::faulted; }
  bool moves() const { return now().drive.value != 0.0; }
  std::string cause() const { return now().cause.c_str(); }
  bool ask(daemon::Command::Kind kind) {
    daemon::Command command;
    command.kind = kind;
    return static_cast<bool>(loop_->ask(command));
  }

 private:
  drivers::Driver& bench_;
  drivers::MonotonicHostClock clock_;
  daemon::Ledger ledger_;
  std::unique_ptr<daemon::Loop> loop_;
  std::jthread thread_;
};

/// A bench on which nothing moves.
class Still final : public Wires {
 public:
  double truth(Channel, std::int64_t) override { return 1e-3; }
  void drive(double, std::int64_t) override {}
  void enable(bool on, std::int64_t) override { on_ = on; }
  bool is_on() const { return on_; }

 private:
  std::atomic<bool> on_ = false;
};

/// The loop ends with an output that does not follow its command, and names it.
inline void expect_output_differs(const LoopOnABench& loop, const std::string& part_of_cause) {
  ASSERT_TRUE(eventually([&] { return loop.faulted(); }));
  EXPECT_EQ(loop.now().interlock, daemon::Interlock::output_differs);
  EXPECT_THAT(loop.cause(), testing::HasSubstr(part_of_cause));
}

}  // namespace stickslip::emulated
